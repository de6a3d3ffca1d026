#pragma once

#include <span>
#include <vector>

/// Internal to solver/.
namespace sinew {

/// Cuts the nodes of a graph into runs [cut[k], cut[k+1]) such that every neighbor of a node in run k
/// lies in run k-1, k or k+1. Depends on the graph alone, never on a thread count. In breadth-first
/// order the runs are a few fronts wide; in a scattered order there is one run. O(nodes).
std::vector<int> sweep_blocks(std::span<const int> offsets, std::span<const int> neighbors);

/// Runs of nearly equal length over `count` items, for loops whose blocks are independent.
int even_block_count(int count, int smallest_block);
inline int even_block_begin(int count, int blocks, int block) {
  return static_cast<int>(static_cast<long long>(count) * block / blocks);
}

}  // namespace sinew
