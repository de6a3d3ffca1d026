#include "solver/lanes.h"

#include <cstring>

namespace sinew {
namespace {

constexpr std::size_t kAlignment = sizeof(Lanes<kWidestLanes>::Double);

}  // namespace

AlignedMemory::AlignedMemory(std::size_t bytes) : bytes_((bytes + kAlignment - 1) / kAlignment * kAlignment) {
  if (bytes_ == 0) return;
  memory_.reset(allocate_in_large_pages(bytes_));
  std::memset(memory_.get(), 0, bytes_);
}

}  // namespace sinew
