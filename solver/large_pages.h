#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace sinew {

/// Memory for arrays that are walked out of order. From 2 MB on it asks the system for large pages,
/// of which a walk meets five hundred times fewer: fewer to look up, and fewer to be given one by one
/// when the array is first written. Aligned to 128 bytes at least. Throws std::bad_alloc.
void* allocate_in_large_pages(std::size_t bytes);
void free_large_pages(void* memory);

template <typename T>
struct LargePages {
  using value_type = T;

  LargePages() = default;
  template <typename U>
  LargePages(const LargePages<U>&) {}

  T* allocate(std::size_t count) {
    if (count > static_cast<std::size_t>(-1) / sizeof(T)) throw std::bad_array_new_length();
    return static_cast<T*>(allocate_in_large_pages(count * sizeof(T)));
  }
  void deallocate(T* memory, std::size_t) { free_large_pages(memory); }

  friend bool operator==(const LargePages&, const LargePages&) { return true; }
};

template <typename T>
using LargeVector = std::vector<T, LargePages<T>>;

}  // namespace sinew
