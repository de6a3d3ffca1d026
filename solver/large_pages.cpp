#include "solver/large_pages.h"

#include <sys/mman.h>

#include <cstdlib>

namespace sinew {
namespace {

constexpr std::size_t kAlignment = 128;
constexpr std::size_t kLargePage = std::size_t{1} << 21;

}  // namespace

void* allocate_in_large_pages(std::size_t bytes) {
  const bool large = bytes >= kLargePage;
  const std::size_t alignment = large ? kLargePage : kAlignment;
  void* memory = nullptr;
  if (posix_memalign(&memory, alignment, bytes) != 0) throw std::bad_alloc();
#ifdef MADV_HUGEPAGE
  // Whole pages alone: what is left over stays in small ones, so that no more memory is taken. A wish:
  // where it is not granted, the memory is what it would have been.
  if (large) madvise(memory, bytes / kLargePage * kLargePage, MADV_HUGEPAGE);
#endif
  return memory;
}

void free_large_pages(void* memory) {
  std::free(memory);
}

}  // namespace sinew
