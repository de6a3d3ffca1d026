#include "solver/galerkin.h"

#include <algorithm>

#include "solver/lattice_coarsening.h"
#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

constexpr int kCorners = 8;

/// Coarse rows made in one go. A slab recomputes what it shares with its neighbors at its ends, so it should
/// be long against a breadth-first front of coarse nodes; but it keeps the rows of its pieces in memory.
constexpr int kFewestSlabRows = 256;
constexpr int kMostSlabRows = 16384;

// Rows come out the same however they are cut, so the cut may look at the team.
int slab_count(int rows, const ThreadTeam& team) {
  const int shared = std::min(rows / kFewestSlabRows, team.thread_count() == 1 ? 1 : 4 * team.thread_count());
  return std::max({1, shared, rows / kMostSlabRows});
}

using Eight = Lanes<kCorners>;

struct EightSums {
  Eight::Double value{};
};

// What one piece's nodes give to another's corners: a row for each of their own eight corners.
struct Block {
  Eight::Double rows[kCorners] = {};
};

struct FineNodes {
  LargeVector<int> piece;  // by fine node
  LargeVector<Eight::Float> weights;
};

FineNodes by_fine_node(const PieceTransfer& transfer, ThreadTeam& team) {
  constexpr int fewest_pieces = 512;
  FineNodes fine;
  fine.piece.resize(transfer.nodes.size());
  fine.weights.resize(transfer.nodes.size());
  for_items(team, transfer.piece_count(), fewest_pieces, [&](int p) {
    for (int entry = transfer.piece_offsets[p]; entry < transfer.piece_offsets[p + 1]; ++entry) {
      const auto node = static_cast<std::size_t>(transfer.nodes[entry]);
      fine.piece[node] = p;
      trilinear_weights(&transfer.places[3 * static_cast<std::size_t>(entry)],
                        reinterpret_cast<float*>(&fine.weights[node]));
    }
  });
  return fine;
}

// Gives numbers 0, 1, ... to the few coarse nodes (or pieces) met, without clearing a table each time.
class LocalNumbers {
 public:
  explicit LocalNumbers(int count) : local_(static_cast<std::size_t>(count), -1) {}
  int operator()(int global) {
    if (local_[global] < 0) {
      local_[global] = static_cast<int>(met_.size());
      met_.push_back(global);
    }
    return local_[global];
  }
  const std::vector<int>& met() const { return met_; }
  void clear() {
    for (int global : met_) local_[global] = -1;
    met_.clear();
  }

 private:
  std::vector<int> local_;
  std::vector<int> met_;
};

// What one piece contributes to the coarse rows of its eight corners.
struct PieceRows {
  std::vector<int> columns;    // coarse nodes
  std::vector<double> values;  // kCorners x columns, row after row
};

class Slab {
 public:
  Slab(const LevelMatrix& A, const PieceTransfer& transfer, const FineNodes& fine)
      : A_(A),
        transfer_(transfer),
        fine_(fine),
        pieces_(transfer.piece_count()),
        near_(transfer.piece_count()),
        columns_(transfer.coarse_count + 1) {}

  // Rows [begin, end) of the product, with offsets counted from this slab's first entry.
  LevelMatrix rows(int begin, int end) {
    for (int use = transfer_.use_offsets[begin]; use < transfer_.use_offsets[end]; ++use)
      pieces_(transfer_.uses[use] / kCorners);
    piece_rows_.resize(pieces_.met().size());
    for (std::size_t k = 0; k < pieces_.met().size(); ++k) fill_piece(pieces_.met()[k], piece_rows_[k]);
    LevelMatrix result;
    for (int row = begin; row < end; ++row) append_row(row, result);
    return result;
  }

 private:
  // The pieces that the nodes of one piece are joined to, numbered from 0, and the local columns of
  // their corners.
  void meet_pieces(int piece) {
    near_.clear();
    columns_.clear();
    near_(piece);
    for (int entry = transfer_.piece_offsets[piece]; entry < transfer_.piece_offsets[piece + 1]; ++entry) {
      const int node = transfer_.nodes[entry];
      for (int k = A_.offsets[node]; k < A_.offsets[node + 1]; ++k) near_(fine_.piece[A_.neighbors[k]]);
    }
    near_columns_.clear();
    for (int met : near_.met())
      for (int k = 0; k < kCorners; ++k)
        near_columns_.push_back(columns_(transfer_.corners[static_cast<std::size_t>(kCorners) * met + k]));
    near_sums_.assign(near_.met().size(), {});
  }

  void add_weights(int node, double factor) {
    const int near = near_(fine_.piece[node]);
    if (!near_touched_[near]) {
      near_touched_[near] = 1;
      touched_.push_back(near);
    }
    near_sums_[near].value += factor * __builtin_convertvector(fine_.weights[node], Eight::Double);
  }

  // Row of A P at one fine node, times its weights: one block of eight by eight per piece it is joined to.
  void add_node(int node) {
    touched_.clear();
    add_weights(node, A_.diagonal[node]);
    for (int k = A_.offsets[node]; k < A_.offsets[node + 1]; ++k) add_weights(A_.neighbors[k], -A_.weight(k));
    const Eight::Float& weights = fine_.weights[node];
    for (int near : touched_) {
      const Eight::Double sums = near_sums_[near].value;
      Block& block = blocks_[near];
      for (int corner = 0; corner < kCorners; ++corner)
        block.rows[corner] += static_cast<double>(weights[corner]) * sums;
      near_sums_[near] = {};
      near_touched_[near] = 0;
    }
  }

  // The rows of P^T (A P) that the nodes of one piece give to its eight corners.
  void fill_piece(int piece, PieceRows& out) {
    meet_pieces(piece);
    const std::size_t near_count = near_.met().size();
    near_touched_.assign(near_count, 0);
    blocks_.assign(near_count, {});
    for (int entry = transfer_.piece_offsets[piece]; entry < transfer_.piece_offsets[piece + 1]; ++entry)
      add_node(transfer_.nodes[entry]);
    out.columns = columns_.met();
    const std::size_t width = out.columns.size();
    out.values.assign(kCorners * width, 0.0);
    for (std::size_t near = 0; near < near_count; ++near)
      for (int corner = 0; corner < kCorners; ++corner)
        for (int k = 0; k < kCorners; ++k)
          out.values[corner * width + near_columns_[kCorners * near + k]] += blocks_[near].rows[corner][k];
    columns_.clear();
  }

  void append_row(int row, LevelMatrix& result) {
    row_.clear();
    for (int use = transfer_.use_offsets[row]; use < transfer_.use_offsets[row + 1]; ++use)
      add_piece_row(transfer_.uses[use]);
    order_ = columns_.met();
    std::sort(order_.begin(), order_.end());
    for (int column : order_) {
      const double value = row_[columns_(column)];
      if (column == transfer_.coarse_count) continue;
      if (column == row) {
        result.diagonal.push_back(static_cast<float>(value));
      } else if (static_cast<float>(value) != 0) {
        result.neighbors.push_back(column);
        result.weights.push_back(static_cast<float>(-value));
      }
    }
    result.offsets.push_back(static_cast<int>(result.neighbors.size()));
    columns_.clear();
  }

  void add_piece_row(int use) {
    const PieceRows& rows = piece_rows_[pieces_(use / kCorners)];
    const double* values = &rows.values[(use % kCorners) * rows.columns.size()];
    for (std::size_t k = 0; k < rows.columns.size(); ++k) {
      const auto column = static_cast<std::size_t>(columns_(rows.columns[k]));
      if (column >= row_.size()) row_.resize(column + 1, 0.0);
      row_[column] += values[k];
    }
  }

  const LevelMatrix& A_;
  const PieceTransfer& transfer_;
  const FineNodes& fine_;
  LocalNumbers pieces_;   // that this slab needs
  LocalNumbers near_;     // that one piece is joined to
  LocalNumbers columns_;  // coarse nodes
  std::vector<int> near_columns_;
  std::vector<Block> blocks_;         // by near piece
  std::vector<EightSums> near_sums_;  // by near piece: what the current fine node reads of its corners
  std::vector<char> near_touched_;
  std::vector<int> touched_;
  std::vector<PieceRows> piece_rows_;
  std::vector<double> row_;
  std::vector<int> order_;
};

void append(const LevelMatrix& part, LevelMatrix& whole) {
  const int base = static_cast<int>(whole.neighbors.size());
  whole.neighbors.insert(whole.neighbors.end(), part.neighbors.begin(), part.neighbors.end());
  whole.weights.insert(whole.weights.end(), part.weights.begin(), part.weights.end());
  whole.diagonal.insert(whole.diagonal.end(), part.diagonal.begin(), part.diagonal.end());
  for (std::size_t i = 1; i < part.offsets.size(); ++i) whole.offsets.push_back(base + part.offsets[i]);
}

}  // namespace

LevelMatrix galerkin_product(const LevelMatrix& A, const PieceTransfer& transfer, ThreadTeam& team) {
  const FineNodes fine = by_fine_node(transfer, team);
  const int slabs = slab_count(transfer.coarse_count, team);
  std::vector<LevelMatrix> parts(static_cast<std::size_t>(slabs));
  team.for_each_block(slabs, [&](int slab) {
    Slab work(A, transfer, fine);
    parts[slab] = work.rows(even_block_begin(transfer.coarse_count, slabs, slab),
                            even_block_begin(transfer.coarse_count, slabs, slab + 1));
  });
  LevelMatrix product;
  std::size_t entries = 0;
  for (const LevelMatrix& part : parts) entries += part.neighbors.size();
  product.neighbors.reserve(entries);
  product.weights.reserve(entries);
  product.diagonal.reserve(static_cast<std::size_t>(transfer.coarse_count));
  product.offsets.reserve(static_cast<std::size_t>(transfer.coarse_count) + 1);
  for (LevelMatrix& part : parts) {
    append(part, product);
    part = {};
  }
  finish_level(product);
  return product;
}

void finish_level(LevelMatrix& matrix) {
  matrix.inverse_diagonal.resize(matrix.diagonal.size());
  // A row without a diagonal is an equation 0 = 0: its correction stays zero.
  for (std::size_t i = 0; i < matrix.diagonal.size(); ++i)
    matrix.inverse_diagonal[i] = matrix.diagonal[i] > 0 ? 1 / matrix.diagonal[i] : 0.0f;
  LargeVector<float>& weights = matrix.weights;
  if (!weights.empty() &&
      std::all_of(weights.begin(), weights.end(), [&](float w) { return w == weights.front(); })) {
    matrix.uniform_weight = weights.front();
    LargeVector<float>().swap(weights);  // gives the memory back, which clearing would not
  }
  matrix.sweep_blocks = sweep_blocks(matrix.offsets, matrix.neighbors);
}

SparseMatrix to_sparse(const LevelMatrix& matrix) {
  const int n = matrix.size();
  SparseMatrix A(n, n);
  if (n == 0) return A;  // Eigen 3.4 reads behind the rows of an empty matrix
  A.resizeNonZeros(matrix.entries() + n);
  int* const row_begins = A.outerIndexPtr();
  int place = 0;
  const auto put = [&](int column, double value) {
    A.innerIndexPtr()[place] = column;
    A.valuePtr()[place++] = value;
  };
  for (int i = 0; i < n; ++i) {
    row_begins[i] = place;
    int k = matrix.offsets[i];
    const int end = matrix.offsets[i + 1];
    for (; k < end && matrix.neighbors[k] < i; ++k) put(matrix.neighbors[k], -matrix.weight(k));
    put(i, matrix.diagonal[i]);
    for (; k < end; ++k) put(matrix.neighbors[k], -matrix.weight(k));
  }
  row_begins[n] = place;
  return A;
}

}  // namespace sinew
