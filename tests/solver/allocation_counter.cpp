#include "allocation_counter.h"

#include <atomic>
#include <cstddef>

namespace {
std::atomic<long> count{0};
std::atomic<long> bytes{0};

[[maybe_unused]] void note(std::size_t size) {
  ++count;
  bytes += static_cast<long>(size);
}
}  // namespace

long sinew::allocation_count() {
  return count.load();
}

long sinew::allocated_bytes() {
  return bytes.load();
}

#if defined(__GLIBC__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
// glibc lets a program replace the malloc family, and offers its own under these names.
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t size) {
  note(size);
  return __libc_malloc(size);
}
void* calloc(std::size_t items, std::size_t size) {
  note(items * size);
  return __libc_calloc(items, size);
}
void* realloc(void* memory, std::size_t size) {
  note(size);
  return __libc_realloc(memory, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  note(size);
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note(size);
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  note(size);
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? 12 : 0;
}
}
#endif
