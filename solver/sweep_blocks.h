#pragma once

#include <span>
#include <vector>

#include "solver/thread_team.h"

/// Internal to solver/.
namespace sinew {

/// Cuts the nodes of a graph into runs [cut[k], cut[k+1]) such that every neighbor of a node in run k
/// lies in run k-1, k or k+1. Depends on the graph alone, never on a thread count. In breadth-first
/// order the runs are a few fronts wide, along the layers of a lattice a few layers; in a scattered order
/// there is one run. O(nodes).
std::vector<int> sweep_blocks(std::span<const int> offsets, std::span<const int> neighbors);

/// Runs of nearly equal length over `count` items, for loops whose blocks are independent.
int even_block_count(int count, int smallest_block);
inline int even_block_begin(int count, int blocks, int block) {
  return static_cast<int>(static_cast<long long>(count) * block / blocks);
}

/// Calls body(begin, end) for such runs.
template <typename Body>
void for_runs(ThreadTeam& team, int count, int smallest_block, const Body& body) {
  const int blocks = even_block_count(count, smallest_block);
  team.for_each_block(blocks, [&](int block) {
    body(even_block_begin(count, blocks, block), even_block_begin(count, blocks, block + 1));
  });
}

/// Calls body(item) for every item, in such runs.
template <typename Body>
void for_items(ThreadTeam& team, int count, int smallest_block, const Body& body) {
  for_runs(team, count, smallest_block, [&](int begin, int end) {
    for (int item = begin; item < end; ++item) body(item);
  });
}

}  // namespace sinew
