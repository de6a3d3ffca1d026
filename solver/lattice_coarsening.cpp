#include "solver/lattice_coarsening.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>

#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

using Cell = std::array<int, 3>;
using CellKey = std::int64_t;  // the three numbers of a cell in one, for comparisons alone

constexpr int kItemsPerBlock = 4096;
constexpr int kPiecesPerBlock = 256;  // of some twenty nodes each

/// Nodes whose edges say how long edges are.
constexpr int kSampledNodes = 10000;

CellKey key_of(const Cell& cell) {
  return (static_cast<CellKey>(cell[0]) << 42) | (static_cast<CellKey>(cell[1]) << 21) | cell[2];
}

constexpr int kCorners = 8;

int corner_offset(int corner, int axis) {
  return corner >> axis & 1;
}

// Disjoint sets over 0 .. n-1; the smallest member stands for its set. Threads may work on members of their
// own.
class DisjointSets {
 public:
  explicit DisjointSets(int n) : parent_(static_cast<std::size_t>(n)) {
    for (int i = 0; i < n; ++i) parent_[i] = i;
  }
  int find(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  /// Gives what stands for both.
  int unite(int i, int j) {
    i = find(i);
    j = find(j);
    const int least = std::min(i, j);
    parent_[i] = parent_[j] = least;
    return least;
  }

 private:
  LargeVector<int> parent_;
};

struct Pieces {
  LargeVector<int> of_node;
  std::vector<Cell> cells;  // by piece
};

using Joints = std::vector<std::array<int, 2>>;

// Unites what nodes [begin, end) hold of each cell's part of the graph. Gives the edges by which parts hang
// together with those of lower nodes.
Joints unite_some(const LevelMatrix& matrix, const LargeVector<CellKey>& key_of_node, int begin, int end,
                  DisjointSets& parts) {
  Joints joints;
  for (int node = begin; node < end; ++node) {
    int lowest = node;
    // Neighbors ascend, and the later ones look back at this node themselves.
    for (int k = matrix.offsets[node]; k < matrix.offsets[node + 1] && matrix.neighbors[k] < node; ++k) {
      const int neighbor = matrix.neighbors[k];
      if (key_of_node[neighbor] != key_of_node[node]) continue;
      if (neighbor < begin)
        joints.push_back({node, neighbor});
      else if (parts.find(neighbor) != lowest)
        lowest = parts.unite(neighbor, lowest);
    }
  }
  return joints;
}

// The parts of cells that hang together, numbered by their lowest node. However the nodes are shared out
// they are the same, so the shares may look at the team.
Pieces pieces_of_cells(const LevelMatrix& matrix, const LargeVector<Cell>& cell_of_node,
                       const LargeVector<CellKey>& key_of_node, ThreadTeam& team) {
  const int n = matrix.size();
  const int shares = std::min(team.thread_count(), even_block_count(n, kItemsPerBlock));
  DisjointSets parts(n);
  std::vector<Joints> joints(static_cast<std::size_t>(shares));
  team.for_each_block(shares, [&](int share) {
    joints[share] = unite_some(matrix, key_of_node, even_block_begin(n, shares, share),
                               even_block_begin(n, shares, share + 1), parts);
  });
  for (const Joints& some : joints)
    for (const auto& [node, neighbor] : some) parts.unite(node, neighbor);
  Pieces pieces;
  pieces.of_node.resize(static_cast<std::size_t>(n));
  for (int node = 0; node < n; ++node) {
    const int lowest = parts.find(node);
    if (lowest == node) {
      pieces.of_node[node] = static_cast<int>(pieces.cells.size());
      pieces.cells.push_back(cell_of_node[node]);
    } else {
      pieces.of_node[node] = pieces.of_node[lowest];
    }
  }
  return pieces;
}

void group_nodes(std::span<const int> piece_of_node, int piece_count, PieceTransfer& transfer) {
  transfer.piece_offsets.assign(static_cast<std::size_t>(piece_count) + 1, 0);
  for (int piece : piece_of_node) ++transfer.piece_offsets[piece + 1];
  for (int piece = 0; piece < piece_count; ++piece)
    transfer.piece_offsets[piece + 1] += transfer.piece_offsets[piece];
  transfer.nodes.resize(piece_of_node.size());
  std::vector<int> next(transfer.piece_offsets.begin(), transfer.piece_offsets.end() - 1);
  for (std::size_t node = 0; node < piece_of_node.size(); ++node)
    transfer.nodes[next[piece_of_node[node]]++] = static_cast<int>(node);
}

// Makes the shared corners of two joined pieces one, given the cells they lie in.
void unite_corners(int p, int q, const Cell& cell_p, const Cell& cell_q, DisjointSets& corners) {
  for (int k = 0; k < kCorners; ++k) {
    int other = 0;
    for (int axis = 0; axis < 3 && other >= 0; ++axis) {
      const int seen_from_q = corner_offset(k, axis) + cell_p[axis] - cell_q[axis];
      other = seen_from_q < 0 || seen_from_q > 1 ? -1 : other | seen_from_q << axis;
    }
    if (other >= 0) corners.unite(kCorners * p + k, kCorners * q + other);
  }
}

// Pairs of pieces that edges join: those of which [begin, end) hold the later node. Some come twice, from
// both sides.
Joints joined_pieces(const LevelMatrix& matrix, const Pieces& pieces, const PieceTransfer& transfer,
                     int begin, int end) {
  Joints joints;
  std::vector<int> last_seen_from(pieces.cells.size(), -1);
  for (int p = begin; p < end; ++p)
    for (int entry = transfer.piece_offsets[p]; entry < transfer.piece_offsets[p + 1]; ++entry) {
      const int node = transfer.nodes[entry];
      for (int k = matrix.offsets[node]; k < matrix.offsets[node + 1] && matrix.neighbors[k] < node; ++k) {
        const int q = pieces.of_node[matrix.neighbors[k]];
        if (q == p || last_seen_from[q] == p) continue;
        last_seen_from[q] = p;
        joints.push_back({p, q});
      }
    }
  return joints;
}

void unite_joined_pieces(const LevelMatrix& matrix, const Pieces& pieces, const PieceTransfer& transfer,
                         ThreadTeam& team, DisjointSets& corners) {
  const int count = transfer.piece_count();
  const int shares = std::min(team.thread_count(), even_block_count(count, kPiecesPerBlock));
  std::vector<Joints> joints(static_cast<std::size_t>(shares));
  team.for_each_block(shares, [&](int share) {
    joints[share] = joined_pieces(matrix, pieces, transfer, even_block_begin(count, shares, share),
                                  even_block_begin(count, shares, share + 1));
  });
  for (const Joints& some : joints)
    for (const auto& [p, q] : some) unite_corners(p, q, pieces.cells[p], pieces.cells[q], corners);
}

// By root of the corners: whether any node gives weight to it. One that is not used would be an empty
// equation: leave it out.
std::vector<char> corners_in_use(const PieceTransfer& transfer, DisjointSets& corners, ThreadTeam& team) {
  std::vector<char> reached(static_cast<std::size_t>(transfer.piece_count()) * kCorners, 0);
  for_items(team, transfer.piece_count(), kPiecesPerBlock, [&](int p) {
    float weights[kCorners];
    for (int entry = transfer.piece_offsets[p]; entry < transfer.piece_offsets[p + 1]; ++entry) {
      trilinear_weights(&transfer.places[3 * static_cast<std::size_t>(entry)], weights);
      for (int k = 0; k < kCorners; ++k)
        if (weights[k] > 0) reached[static_cast<std::size_t>(kCorners) * p + k] = 1;
    }
  });
  std::vector<char> used(reached.size(), 0);
  for (std::size_t slot = 0; slot < reached.size(); ++slot)
    if (reached[slot]) used[corners.find(static_cast<int>(slot))] = 1;
  return used;
}

// Numbers the coarse nodes in the order their pieces come, which is the order of the fine nodes.
void number_corners(const std::vector<Cell>& cells, const std::vector<char>& used, DisjointSets& corners,
                    PieceCoarsening& result) {
  PieceTransfer& transfer = result.transfer;
  const std::size_t slots = cells.size() * kCorners;
  std::vector<int> coarse_of_root(slots, -1);
  std::vector<Eigen::Vector3d> positions;
  transfer.corners.assign(slots, -1);
  for (std::size_t slot = 0; slot < slots; ++slot) {
    const int root = corners.find(static_cast<int>(slot));
    if (!used[root]) continue;
    if (coarse_of_root[root] < 0) {
      coarse_of_root[root] = static_cast<int>(positions.size());
      const Cell& cell = cells[slot / kCorners];
      const int corner = static_cast<int>(slot % kCorners);
      positions.emplace_back(cell[0] + corner_offset(corner, 0), cell[1] + corner_offset(corner, 1),
                             cell[2] + corner_offset(corner, 2));
    }
    transfer.corners[slot] = coarse_of_root[root];
  }
  transfer.coarse_count = static_cast<int>(positions.size());
  result.positions.resize(transfer.coarse_count, 3);
  for (int c = 0; c < transfer.coarse_count; ++c) result.positions.row(c) = positions[c].transpose();
}

// Unused corners read the spare row behind the coarse nodes; the others are listed by coarse node.
void list_corner_uses(PieceTransfer& transfer) {
  transfer.use_offsets.assign(static_cast<std::size_t>(transfer.coarse_count) + 1, 0);
  for (int& corner : transfer.corners) {
    if (corner < 0)
      corner = transfer.coarse_count;
    else
      ++transfer.use_offsets[corner + 1];
  }
  for (int c = 0; c < transfer.coarse_count; ++c) transfer.use_offsets[c + 1] += transfer.use_offsets[c];
  transfer.uses.resize(static_cast<std::size_t>(transfer.use_offsets.back()));
  std::vector<int> next(transfer.use_offsets.begin(), transfer.use_offsets.end() - 1);
  for (std::size_t slot = 0; slot < transfer.corners.size(); ++slot)
    if (transfer.corners[slot] < transfer.coarse_count)
      transfer.uses[next[transfer.corners[slot]]++] = static_cast<int>(slot);
}

// aggregate_of_node, or -1 for nodes without neighbors. First whole neighborhoods that do not touch,
// then what is left joins the aggregate it is tied to most strongly.
std::vector<int> aggregate(const LevelMatrix& matrix, int& count) {
  const int n = matrix.size();
  std::vector<int> result(static_cast<std::size_t>(n), -1);
  count = 0;
  for (int node = 0; node < n; ++node) {
    const auto begin = matrix.neighbors.begin() + matrix.offsets[node];
    const auto end = matrix.neighbors.begin() + matrix.offsets[node + 1];
    if (begin == end || result[node] >= 0) continue;
    if (std::any_of(begin, end, [&](int neighbor) { return result[neighbor] >= 0; })) continue;
    result[node] = count;
    for (auto neighbor = begin; neighbor != end; ++neighbor) result[*neighbor] = count;
    ++count;
  }
  const std::vector<int> seeds = result;
  for (int node = 0; node < n; ++node) {
    if (result[node] >= 0) continue;
    float strongest = 0;
    for (int k = matrix.offsets[node]; k < matrix.offsets[node + 1]; ++k)
      if (seeds[matrix.neighbors[k]] >= 0 && matrix.weight(k) > strongest) {
        strongest = matrix.weight(k);
        result[node] = seeds[matrix.neighbors[k]];
      }
    if (result[node] < 0 && matrix.offsets[node] < matrix.offsets[node + 1]) result[node] = count++;
  }
  return result;
}

}  // namespace

Eigen::AlignedBox3d box_around(const Field3& positions, ThreadTeam& team) {
  const int n = static_cast<int>(positions.rows());
  const int blocks = even_block_count(n, kItemsPerBlock);
  std::vector<Eigen::AlignedBox3d> boxes(static_cast<std::size_t>(blocks));
  std::vector<char> finite(static_cast<std::size_t>(blocks), 0);
  team.for_each_block(blocks, [&](int block) {
    Eigen::AlignedBox3d box;
    bool all_finite = true;
    for (int i = even_block_begin(n, blocks, block); i < even_block_begin(n, blocks, block + 1); ++i) {
      const Eigen::Vector3d position = positions.row(i).transpose();
      all_finite &= position.allFinite();
      box.extend(position);
    }
    boxes[block] = box;
    finite[block] = all_finite ? 1 : 0;
  });
  Eigen::AlignedBox3d box;
  for (int block = 0; block < blocks; ++block) {
    if (finite[block] == 0) return {};
    box.extend(boxes[block]);
  }
  return box;
}

double mean_edge_length(const LevelMatrix& matrix, const Field3& positions, ThreadTeam& team) {
  const int stride = std::max(1, matrix.size() / kSampledNodes);
  const int samples = (matrix.size() + stride - 1) / stride;
  const int blocks = even_block_count(samples, kItemsPerBlock);
  std::vector<double> sums(static_cast<std::size_t>(blocks), 0.0);
  std::vector<std::int64_t> counts(static_cast<std::size_t>(blocks), 0);
  team.for_each_block(blocks, [&](int block) {
    const int end = even_block_begin(samples, blocks, block + 1);
    for (int sample = even_block_begin(samples, blocks, block); sample < end; ++sample) {
      const int i = sample * stride;
      for (int k = matrix.offsets[i]; k < matrix.offsets[i + 1]; ++k)
        sums[block] += (positions.row(i) - positions.row(matrix.neighbors[k])).norm();
      counts[block] += matrix.offsets[i + 1] - matrix.offsets[i];
    }
  });
  double sum = 0;
  std::int64_t count = 0;
  for (int block = 0; block < blocks; ++block) {
    sum += sums[block];
    count += counts[block];
  }
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

void trilinear_weights(const float* place, float* weights) {
  for (int k = 0; k < kCorners; ++k)
    weights[k] = ((k & 1) != 0 ? place[0] : 1 - place[0]) * ((k & 2) != 0 ? place[1] : 1 - place[1]) *
                 ((k & 4) != 0 ? place[2] : 1 - place[2]);
}

PieceCoarsening coarsen_by_lattice(const LevelMatrix& matrix, const Field3& positions, double cell,
                                   ThreadTeam& team) {
  const int n = matrix.size();
  const Eigen::Vector3d origin = box_around(positions, team).min();
  LargeVector<Cell> cell_of_node(static_cast<std::size_t>(n));
  LargeVector<CellKey> key_of_node(static_cast<std::size_t>(n));
  for_items(team, n, kItemsPerBlock, [&](int i) {
    for (int axis = 0; axis < 3; ++axis)
      cell_of_node[i][axis] = static_cast<int>((positions(i, axis) - origin[axis]) / cell);
    key_of_node[i] = key_of(cell_of_node[i]);
  });
  const Pieces pieces = pieces_of_cells(matrix, cell_of_node, key_of_node, team);

  PieceCoarsening result;
  PieceTransfer& transfer = result.transfer;
  transfer.linear = true;
  group_nodes(pieces.of_node, static_cast<int>(pieces.cells.size()), transfer);
  transfer.places.resize(3 * static_cast<std::size_t>(n));
  for_items(team, n, kItemsPerBlock, [&](int entry) {
    const int node = transfer.nodes[entry];
    for (int axis = 0; axis < 3; ++axis)
      transfer.places[3 * static_cast<std::size_t>(entry) + axis] =
          static_cast<float>((positions(node, axis) - origin[axis]) / cell - cell_of_node[node][axis]);
  });

  DisjointSets corners(static_cast<int>(pieces.cells.size()) * kCorners);
  unite_joined_pieces(matrix, pieces, transfer, team, corners);
  const std::vector<char> used = corners_in_use(transfer, corners, team);
  number_corners(pieces.cells, used, corners, result);
  list_corner_uses(transfer);
  return result;
}

PieceCoarsening coarsen_by_aggregation(const LevelMatrix& matrix, const Field3& positions) {
  int count = 0;
  std::vector<int> piece_of_node = aggregate(matrix, count);
  const bool some_alone = std::find(piece_of_node.begin(), piece_of_node.end(), -1) != piece_of_node.end();
  std::replace(piece_of_node.begin(), piece_of_node.end(), -1, count);

  PieceCoarsening result;
  PieceTransfer& transfer = result.transfer;
  group_nodes(piece_of_node, count + (some_alone ? 1 : 0), transfer);
  transfer.places.assign(3 * piece_of_node.size(), 0.0f);
  transfer.coarse_count = count;
  transfer.corners.assign(kCorners * static_cast<std::size_t>(transfer.piece_count()), -1);
  result.positions.setZero(count, 3);
  for (int piece = 0; piece < count; ++piece) {
    transfer.corners[static_cast<std::size_t>(kCorners) * piece] = piece;
    const int begin = transfer.piece_offsets[piece], end = transfer.piece_offsets[piece + 1];
    for (int entry = begin; entry < end; ++entry)
      result.positions.row(piece) += positions.row(transfer.nodes[entry]) / (end - begin);
  }
  list_corner_uses(transfer);
  return result;
}

}  // namespace sinew
