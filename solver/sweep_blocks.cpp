#include "solver/sweep_blocks.h"

#include <algorithm>

namespace sinew {
namespace {

/// Enough runs to share among many threads, and each long enough to be worth handing over.
constexpr int kMostBlocks = 64;
constexpr int kSmallestBlock = 512;

// reach[i]: the lowest-numbered neighbor of any node from i on.
std::vector<int> lowest_reach(std::span<const int> offsets, std::span<const int> neighbors) {
  const int n = static_cast<int>(offsets.size()) - 1;
  std::vector<int> reach(static_cast<std::size_t>(n) + 1, n);
  for (int i = n - 1; i >= 0; --i) {
    const int own =
        offsets[i] < offsets[i + 1] ? neighbors[offsets[i]] : i;  // ascending: the first is lowest
    reach[i] = std::min({reach[i + 1], own, i});
  }
  return reach;
}

}  // namespace

std::vector<int> sweep_blocks(std::span<const int> offsets, std::span<const int> neighbors) {
  const int n = static_cast<int>(offsets.size()) - 1;
  const std::vector<int> reach = lowest_reach(offsets, neighbors);
  const int wanted = std::max(kSmallestBlock, n / kMostBlocks);
  std::vector<int> cuts = {0};
  for (int start = 0;;) {
    int end = std::min(n, start + wanted);
    // Whatever comes from `end` on must reach no further back than this run.
    while (end < n && reach[end] < start) ++end;
    if (n - end < wanted / 2) end = n;
    if (end >= n) break;
    cuts.push_back(end);
    start = end;
  }
  cuts.push_back(n);
  return cuts;
}

int even_block_count(int count, int smallest_block) {
  return std::clamp(count / std::max(1, smallest_block), 1, kMostBlocks);
}

}  // namespace sinew
