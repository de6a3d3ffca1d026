#include "solver/lanes.h"

#include <cstring>

namespace sinew {

AlignedMemory::AlignedMemory(std::size_t bytes) : bytes_((bytes + 63) / 64 * 64) {
  if (bytes_ == 0) return;
  memory_.reset(std::aligned_alloc(64, bytes_));
  if (!memory_) throw std::bad_alloc();
  std::memset(memory_.get(), 0, bytes_);
}

}  // namespace sinew
