#pragma once

#include <cstddef>
#include <memory>

#include "solver/large_pages.h"
#include "solver/wide.h"

/// Internal to solver/. Several right-hand sides side by side: one short vector per node.
namespace sinew {

/// `kWidth` numbers that are added, scaled and stored as one.
template <int kWidth>
struct Lanes {
  using Float = Wide<float, kWidth>;
  using Double = Wide<double, kWidth>;
};

/// The widest group of columns a cycle works on.
constexpr int kWidestLanes = 16;

/// Width of the group that takes the next columns when `columns` are left.
constexpr int lanes_for(int columns) {
  return columns <= 4 ? 4 : columns <= 8 ? 8 : 16;
}

/// Zeroed memory aligned for the widest short vector, so that none straddles two cache lines in vain.
class AlignedMemory {
 public:
  AlignedMemory() = default;
  explicit AlignedMemory(std::size_t bytes);

  template <typename T>
  T* as() const {
    return static_cast<T*>(memory_.get());
  }
  std::size_t bytes() const { return bytes_; }

 private:
  struct Free {
    void operator()(void* memory) const { free_large_pages(memory); }
  };
  std::unique_ptr<void, Free> memory_;
  std::size_t bytes_ = 0;
};

}  // namespace sinew
