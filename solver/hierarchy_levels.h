#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "solver/coarse_factor.h"
#include "solver/hierarchy.h"
#include "solver/large_pages.h"
#include "solver/patches.h"
#include "solver/short_rows.h"

/// Internal to solver/: the flat arrays of a Hierarchy, for the files that build and sweep them.
namespace sinew {

/// Symmetric matrix in single precision: A(i,i) = diagonal[i], A(i,j) = -weight of the entry.
struct LevelMatrix {
  LargeVector<int> offsets = {0};  ///< size() + 1
  LargeVector<int> neighbors;      ///< ascending per node; empty where short_rows says the same
  /// Alongside neighbors; empty when all equal uniform_weight, those of a graph in double.
  LargeVector<float> weights;
  float uniform_weight = 0;
  LargeVector<float> diagonal;          ///< positive
  LargeVector<float> inverse_diagonal;  ///< what a sweep multiplies by

  /// Nodes [sweep_blocks[k], sweep_blocks[k+1]) have neighbors in blocks k-1, k and k+1 alone, so
  /// all even blocks can be swept at once, and then all odd ones.
  std::vector<int> sweep_blocks;

  /// The finest level's, once the coarser ones are made of it, where its weights are all equal.
  ShortRows short_rows;

  int size() const { return static_cast<int>(offsets.size()) - 1; }
  int entries() const { return offsets.back(); }
  float weight(int entry) const { return weights.empty() ? uniform_weight : weights[entry]; }
  std::size_t bytes() const;
};

/// Interpolation from the corners of lattice cells. The nodes of one cell that hang together form a
/// piece; a piece has up to eight corners, each a coarse node, and a node's value is the trilinear
/// blend of its piece's corners. A piece with one corner is an aggregate: all its nodes take that
/// coarse node's value.
struct PieceTransfer {
  LargeVector<int> piece_offsets = {0};  ///< piece_count() + 1
  LargeVector<int> nodes;                ///< fine nodes, grouped by piece, ascending in each
  LargeVector<float> places;             ///< three per entry of `nodes`: x y z in the cell, in [0, 1)
  LargeVector<int> corners;              ///< eight per piece; coarse_count where nothing is read

  /// Coarse node c is corner k of piece p for the entries 8 p + k in
  /// uses[use_offsets[c]] .. uses[use_offsets[c + 1]].
  LargeVector<int> use_offsets = {0};
  LargeVector<int> uses;

  int coarse_count = 0;
  bool linear = false;  ///< linear functions of the positions are interpolated exactly

  int piece_count() const { return static_cast<int>(piece_offsets.size()) - 1; }
  std::size_t bytes() const;
};

/// Interpolation by rows of weights: x_i += sum_j value x'_j + own_share_i r_i, with r the residual.
/// The transposed rows run alongside, for the restriction.
struct RowTransfer {
  std::vector<int> offsets = {0};  ///< by fine node
  std::vector<int> coarse_nodes;
  std::vector<float> values;
  std::vector<int> transposed_offsets = {0};  ///< by coarse node
  std::vector<int> fine_nodes;
  std::vector<float> transposed_values;
  std::vector<float> own_share;  ///< by fine node
  int coarse_count = 0;

  std::size_t bytes() const;
};

/// How the original equations of [Shi et al. 2006] go one level down and their answer comes up again.
/// "Entries" count along LevelMatrix::neighbors of the finer (or coarser) level.
struct EdgeDescent {
  std::vector<int> coarse_of_fine;  ///< -1 for retained nodes
  std::vector<int> fine_of_coarse;
  std::vector<float> anchor;         ///< by fine node: alpha
  std::vector<float> inverse_reach;  ///< by retained fine node: 1 / Z of eq. (14); 0 for elevated ones

  /// The target of a coarse entry is the sum of share * (target of first + target of second entry) over
  /// its paths [path_offsets[entry], path_offsets[entry + 1]); shares sum to 1. A direct edge has -1
  /// for its second entry.
  std::vector<int> path_offsets = {0};
  std::vector<int> first_entries;
  std::vector<int> second_entries;
  std::vector<float> shares;

  std::size_t bytes() const;
};

/// How a level reaches the next coarser one: one of the two.
struct Transfer {
  std::optional<PieceTransfer> pieces;
  std::optional<RowTransfer> rows;
  std::size_t bytes() const { return (pieces ? pieces->bytes() : 0) + (rows ? rows->bytes() : 0); }
};

/// A number between 0 and 1 in units of 1/kKeptUnits, rounded up.
using KeptShare = std::uint8_t;
constexpr float kKeptUnits = 255.0f;

struct Hierarchy::Members {
  std::vector<LevelMatrix> matrices;   ///< the finest first
  std::vector<Transfer> transfers;     ///< transfers[l] joins levels l and l + 1
  std::vector<EdgeDescent> descents;   ///< likewise, for Coarsening::shi2006 alone
  std::vector<Patch> patches;          ///< of the finest level
  LargeVector<KeptShare> kept;         ///< what cycles keep of errors, by node of the finest level, where it
                                       ///< was searched for patches
  std::optional<CoarseFactor> bottom;  ///< absent when the last level is too large to factor: it is swept
};

template <typename Vector>
std::size_t bytes_of(const Vector& values) {
  return values.capacity() * sizeof(typename Vector::value_type);
}

}  // namespace sinew
