#include "solver/patch_search.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>

#include "solver/cycle.h"
#include "solver/galerkin.h"
#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

/// Nodes per block of parallel work.
constexpr int kRowsPerBlock = 4096;

constexpr int kProbeSweeps = 2;
constexpr int kProbeCycles = 4;

/// What the probe may leave of numbers between -1 and 1: a fifth a cycle, as much as the body at large keeps.
/// A fifth cycle would tell the stubborn nodes no better.
constexpr float kStubborn = 1.8e-3f;

/// Edges from the stubborn nodes to the rim of their patch, where the error that is cut off must be rough.
constexpr int kRings = 2;

constexpr int kFewestOfNodes = 20;  ///< at most one node in this many is taken,
constexpr int kMostNodes = 20000;   ///< and no more than this: factors grow faster than their patches

/// Small patches share a factor until it has as many nodes.
constexpr int kFewestInFactor = 256;

/// Between -1 and 1, without pattern in `seed` [Steele, Lea, Flood 2014].
float scattered(std::uint64_t seed) {
  std::uint64_t z = (seed + 1) * 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  z ^= z >> 31;
  return static_cast<float>(static_cast<double>(z >> 11) * 0x1p-52 - 1.0);
}

/// By node: the length of what the probe leaves.
std::vector<float> probe(const Hierarchy::Members& hierarchy, ThreadTeam& team) {
  constexpr int kWidth = 4;
  CycleMemory memory(hierarchy, kWidth);
  Cycle<kWidth> cycle(hierarchy, kProbeSweeps, team, memory);
  const int n = hierarchy.matrices.front().size();
  auto* const error = cycle.solution();
  for_items(team, n, kRowsPerBlock, [&](int node) {
    for (int lane = 0; lane < kWidth; ++lane)
      error[node][lane] = scattered(static_cast<std::uint64_t>(node) * kWidth + lane);
  });
  for (int k = 0; k < kProbeCycles; ++k) cycle.improve(0);
  std::vector<float> left(n);
  for_items(team, n, kRowsPerBlock, [&](int node) {
    const auto square = error[node] * error[node];
    left[node] = std::sqrt(square[0] + square[1] + square[2] + square[3]);
  });
  return left;
}

/// The limit above which a node is stubborn: raised until few enough are.
float limit_for(std::vector<float> left) {
  const auto most = std::min<std::size_t>(left.size() / kFewestOfNodes, kMostNodes);
  const auto nth = left.begin() + static_cast<std::ptrdiff_t>(most);
  std::nth_element(left.begin(), nth, left.end(), std::greater<>());
  return std::max(kStubborn, *nth);
}

/// What a cycle left in the mean.
LargeVector<KeptShare> kept_shares(const std::vector<float>& left, float limit, ThreadTeam& team) {
  static_assert(kProbeCycles == 4);
  LargeVector<KeptShare> kept(left.size());
  for_items(team, static_cast<int>(left.size()), kRowsPerBlock, [&](int node) {
    const float share = std::sqrt(std::sqrt(std::min(limit, left[node])));  // what is not a number: the limit
    kept[node] = static_cast<KeptShare>(std::ceil(kKeptUnits * std::min(share, 1.0f)));
  });
  return kept;
}

/// The stubborn nodes and those within some edges of them.
std::vector<char> nodes_in_patches(const LevelMatrix& A, const std::vector<float>& left, float limit) {
  std::vector<char> inside(left.size(), 0);
  std::vector<int> front;
  for (int node = 0; node < A.size(); ++node) {
    if (!(left[node] > limit)) continue;
    inside[node] = 1;
    front.push_back(node);
  }
  for (int ring = 0; ring < kRings; ++ring) {
    std::vector<int> next;
    for (const int node : front) {
      for (int k = A.offsets[node]; k < A.offsets[node + 1]; ++k) {
        char& neighbor = inside[A.neighbors[k]];
        if (neighbor != 0) continue;
        neighbor = 1;
        next.push_back(A.neighbors[k]);
      }
    }
    front = std::move(next);
  }
  return inside;
}

/// The nodes inside that hang together with `start`, which leave `inside`.
void take_component(const LevelMatrix& A, int start, std::vector<char>& inside, std::vector<int>& nodes) {
  std::size_t next = nodes.size();
  nodes.push_back(start);
  inside[start] = 0;
  for (; next < nodes.size(); ++next) {
    for (int k = A.offsets[nodes[next]]; k < A.offsets[nodes[next] + 1]; ++k) {
      char& neighbor = inside[A.neighbors[k]];
      if (neighbor == 0) continue;
      neighbor = 0;
      nodes.push_back(A.neighbors[k]);
    }
  }
}

/// `row_of_node`: where the patch has its nodes, and -1 at all nodes around them.
Patch make_patch(const LevelMatrix& A, std::vector<int> nodes, const std::vector<int>& row_of_node) {
  Patch patch;
  LevelMatrix inner;
  inner.uniform_weight = A.uniform_weight;
  for (const int node : nodes) {
    for (int k = A.offsets[node]; k < A.offsets[node + 1]; ++k) {
      const int row = row_of_node[A.neighbors[k]];
      patch.neighbors.push_back(A.neighbors[k]);
      if (row >= 0) inner.neighbors.push_back(row);
      if (A.weights.empty()) continue;
      patch.weights.push_back(A.weights[k]);
      if (row >= 0) inner.weights.push_back(A.weights[k]);
    }
    patch.offsets.push_back(static_cast<int>(patch.neighbors.size()));
    inner.offsets.push_back(static_cast<int>(inner.neighbors.size()));
    inner.diagonal.push_back(A.diagonal[node]);
  }
  patch.factor = CoarseFactor(to_sparse(inner));
  patch.nodes = std::move(nodes);
  return patch;
}

/// Nodes by patch, ascending in each.
std::vector<std::vector<int>> patch_nodes(const LevelMatrix& A, std::vector<char> inside) {
  std::vector<std::vector<int>> patches;
  std::vector<int> nodes;
  const auto close = [&] {
    if (nodes.empty()) return;
    std::sort(nodes.begin(), nodes.end());
    patches.push_back(std::exchange(nodes, {}));
  };
  for (int node = 0; node < A.size(); ++node) {
    if (inside[node] == 0) continue;
    take_component(A, node, inside, nodes);
    if (static_cast<int>(nodes.size()) >= kFewestInFactor) close();
  }
  close();
  return patches;
}

}  // namespace

std::size_t Patch::bytes() const {
  return bytes_of(nodes) + bytes_of(offsets) + bytes_of(neighbors) + bytes_of(weights) + factor.bytes();
}

PatchSearch find_patches(const Hierarchy::Members& hierarchy, ThreadTeam& team) {
  const LevelMatrix& A = hierarchy.matrices.front();
  const std::vector<float> left = probe(hierarchy, team);
  const float limit = limit_for(left);
  PatchSearch result;
  result.kept = kept_shares(left, limit, team);
  std::vector<std::vector<int>> nodes = patch_nodes(A, nodes_in_patches(A, left, limit));
  std::vector<int> row_of_node(static_cast<std::size_t>(A.size()), -1);
  for (const std::vector<int>& patch : nodes)
    for (std::size_t row = 0; row < patch.size(); ++row) row_of_node[patch[row]] = static_cast<int>(row);
  // No edge joins two patches, so none meets another's rows.
  result.patches.resize(nodes.size());
  team.for_each_block(static_cast<int>(nodes.size()),
                      [&](int k) { result.patches[k] = make_patch(A, std::move(nodes[k]), row_of_node); });
  int first_row = 0;
  for (Patch& patch : result.patches) {
    patch.first_row = first_row;
    first_row += patch.size();
  }
  return result;
}

}  // namespace sinew
