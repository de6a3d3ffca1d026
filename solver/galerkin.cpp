#include "solver/galerkin.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <utility>

#include "solver/lattice_coarsening.h"
#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

constexpr int kCorners = 8;

/// Coarse rows made in one go, at least. A slab recomputes what it shares with the one before it at its
/// beginning, so it should be long against a front of coarse nodes.
constexpr int kFewestSlabRows = 256;

/// Columns of a row are listed in order by marking them in a map of bits while that is no longer than so many
/// words a column, and by sorting them where they lie farther apart.
constexpr int kWordsPerColumn = 4;
constexpr int kWord = 64;

// Rows come out the same however they are cut, so the cut may look at the team.
int slab_count(int rows, const ThreadTeam& team) {
  return std::clamp(rows / kFewestSlabRows, 1, team.thread_count() == 1 ? 1 : 2 * team.thread_count());
}

using Eight = Lanes<kCorners>;

// Numbers of its own, for vectors, whose elements must be aligned as they are.
struct EightSums {
  Eight::Double value{};

  // Number by number: one load that converts, where the vectors' own conversion takes them apart.
  void add(double factor, const float* numbers) {
    for (int k = 0; k < kCorners; ++k) value[k] += factor * static_cast<double>(numbers[k]);
  }
};

// What one piece's nodes give to another's corners: for each of the other's corners, a number by own corner.
struct Block {
  Eight::Double columns[kCorners] = {};
};

struct FineNodes {
  LargeVector<int> piece;      // by fine node
  LargeVector<float> weights;  // kCorners a node

  const float* weights_of(int node) const { return &weights[kCorners * static_cast<std::size_t>(node)]; }
};

FineNodes by_fine_node(const PieceTransfer& transfer, ThreadTeam& team) {
  constexpr int fewest_pieces = 512;
  FineNodes fine;
  fine.piece.resize(transfer.nodes.size());
  fine.weights.resize(kCorners * transfer.nodes.size());
  for_items(team, transfer.piece_count(), fewest_pieces, [&](int p) {
    for (int entry = transfer.piece_offsets[p]; entry < transfer.piece_offsets[p + 1]; ++entry) {
      const auto node = static_cast<std::size_t>(transfer.nodes[entry]);
      fine.piece[node] = p;
      trilinear_weights(&transfer.places[3 * static_cast<std::size_t>(entry)],
                        &fine.weights[kCorners * node]);
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

// Makes rows one after the other. What a piece gives to its rows is made when the first of them asks for it,
// and its place is free for another piece after the last.
class Slab {
 public:
  Slab(const LevelMatrix& A, const PieceTransfer& transfer, const FineNodes& fine)
      : A_(A),
        transfer_(transfer),
        fine_(fine),
        near_(transfer.piece_count()),
        columns_(transfer.coarse_count + 1),
        place_of_piece_(static_cast<std::size_t>(transfer.piece_count()), -1),
        sums_(static_cast<std::size_t>(transfer.coarse_count) + 1),
        row_of_sum_(sums_.size(), -1),
        marks_(sums_.size() / kWord + 1, 0) {}

  // Rows [begin, end) of the product, with offsets counted from this slab's first entry.
  LevelMatrix rows(int begin, int end) {
    LevelMatrix result;
    for (int row = begin; row < end; ++row) append_row(row, result);
    return result;
  }

 private:
  // The pieces that the nodes of one piece are joined to, numbered from 0, that of every link, and the local
  // columns of their corners.
  void meet_pieces(int piece) {
    const int begin = transfer_.piece_offsets[piece], end = transfer_.piece_offsets[piece + 1];
    std::size_t links = 0;
    for (int entry = begin; entry < end; ++entry)
      links += A_.offsets[transfer_.nodes[entry] + 1] - A_.offsets[transfer_.nodes[entry]];
    near_of_link_.resize(links);
    int* near_of_link = near_of_link_.data();
    near_.clear();
    near_(piece);
    for (int entry = begin; entry < end; ++entry) {
      const int node = transfer_.nodes[entry], links_end = A_.offsets[node + 1];
      for (int k = A_.offsets[node]; k < links_end; ++k)
        *near_of_link++ = near_(fine_.piece[A_.neighbors[k]]);
    }
    columns_.clear();
    near_columns_.clear();
    for (int met : near_.met())
      for (int k = 0; k < kCorners; ++k)
        near_columns_.push_back(columns_(transfer_.corners[static_cast<std::size_t>(kCorners) * met + k]));
    near_sums_.resize(near_.met().size());
    near_touched_.assign(near_.met().size(), 0);
    blocks_.assign(near_.met().size(), {});
  }

  void add_weights(int node, int near, double factor) {
    if (!near_touched_[near]) {
      near_touched_[near] = 1;
      touched_.push_back(near);
      near_sums_[near] = {};
    }
    near_sums_[near].add(factor, fine_.weights_of(node));
  }

  // Row of A P at one fine node, times its weights: one block of eight by eight per piece it is joined to.
  // `near`: of the node's links.
  void add_node(int node, const int* near) {
    touched_.clear();
    add_weights(node, 0, A_.diagonal[node]);
    for (int k = A_.offsets[node]; k < A_.offsets[node + 1]; ++k)
      add_weights(A_.neighbors[k], *near++, -A_.weight(k));
    const auto weights = converted<double, kCorners>(loaded<Eight::Float>(fine_.weights_of(node)));
    for (int touched : touched_) {
      const Eight::Double sums = near_sums_[touched].value;
      Block& block = blocks_[touched];
      for (int corner = 0; corner < kCorners; ++corner) block.columns[corner] += sums[corner] * weights;
      near_touched_[touched] = 0;
    }
  }

  // The rows of P^T (A P) that the nodes of one piece give to its eight corners.
  void fill_piece(int piece, PieceRows& out) {
    meet_pieces(piece);
    const int* near = near_of_link_.data();
    for (int entry = transfer_.piece_offsets[piece]; entry < transfer_.piece_offsets[piece + 1]; ++entry) {
      const int node = transfer_.nodes[entry];
      add_node(node, near);
      near += A_.offsets[node + 1] - A_.offsets[node];
    }
    out.columns = columns_.met();
    const std::size_t width = out.columns.size();
    merged_.assign(width, {});
    for (std::size_t k = 0; k < near_columns_.size(); ++k)
      merged_[near_columns_[k]].value += blocks_[k / kCorners].columns[k % kCorners];
    out.values.resize(kCorners * width);
    for (std::size_t column = 0; column < width; ++column)
      for (int corner = 0; corner < kCorners; ++corner)
        out.values[corner * width + column] = merged_[column].value[corner];
    columns_.clear();
  }

  const PieceRows& rows_of(int piece) {
    int& place = place_of_piece_[piece];
    if (place < 0) {
      if (free_places_.empty()) {
        free_places_.push_back(static_cast<int>(piece_rows_.size()));
        piece_rows_.emplace_back();
      }
      place = free_places_.back();
      free_places_.pop_back();
      fill_piece(piece, piece_rows_[place]);
    }
    return piece_rows_[place];
  }

  // Frees the place of a piece that no row behind this one asks for.
  void leave(int piece, int row) {
    int& place = place_of_piece_[piece];
    if (place < 0) return;
    const auto corners = transfer_.corners.begin() + static_cast<std::ptrdiff_t>(kCorners) * piece;
    if (std::any_of(corners, corners + kCorners,
                    [&](int corner) { return corner > row && corner < transfer_.coarse_count; }))
      return;
    free_places_.push_back(std::exchange(place, -1));
  }

  void append_row(int row, LevelMatrix& result) {
    row_columns_.clear();
    for (int use = transfer_.use_offsets[row]; use < transfer_.use_offsets[row + 1]; ++use) {
      const int piece = transfer_.uses[use] / kCorners;
      add_piece_row(row, rows_of(piece), transfer_.uses[use] % kCorners);
    }
    for (int use = transfer_.use_offsets[row]; use < transfer_.use_offsets[row + 1]; ++use)
      leave(transfer_.uses[use] / kCorners, row);
    sort_columns();
    for (int column : row_columns_) {
      const auto value = static_cast<float>(sums_[column]);
      if (column == transfer_.coarse_count) continue;
      if (column == row) {
        result.diagonal.push_back(value);
      } else if (value != 0) {
        result.neighbors.push_back(column);
        result.weights.push_back(-value);
      }
    }
    result.offsets.push_back(static_cast<int>(result.neighbors.size()));
  }

  void add_piece_row(int row, const PieceRows& rows, int corner) {
    const std::size_t width = rows.columns.size();
    const double* values = &rows.values[corner * width];
    for (std::size_t k = 0; k < width; ++k) {
      const int column = rows.columns[k];
      if (row_of_sum_[column] != row) {
        row_of_sum_[column] = row;
        row_columns_.push_back(column);
        sums_[column] = values[k];
      } else {
        sums_[column] += values[k];
      }
    }
  }

  void sort_columns() {
    const auto [least, most] = std::minmax_element(row_columns_.begin(), row_columns_.end());
    const int first = *least / kWord, last = *most / kWord;
    if (last - first > kWordsPerColumn * static_cast<int>(row_columns_.size())) {
      std::sort(row_columns_.begin(), row_columns_.end());
      return;
    }
    for (int column : row_columns_) marks_[column / kWord] |= std::uint64_t{1} << (column % kWord);
    int* next = row_columns_.data();
    for (int word = first; word <= last; ++word) {
      for (std::uint64_t left = marks_[word]; left != 0; left &= left - 1)
        *next++ = kWord * word + std::countr_zero(left);
      marks_[word] = 0;
    }
  }

  const LevelMatrix& A_;
  const PieceTransfer& transfer_;
  const FineNodes& fine_;
  LocalNumbers near_;     // pieces that one piece is joined to
  LocalNumbers columns_;  // coarse nodes
  std::vector<int> near_of_link_;
  std::vector<int> near_columns_;     // kCorners a near piece
  std::vector<Block> blocks_;         // by near piece
  std::vector<EightSums> near_sums_;  // by near piece: what the current fine node reads of its corners
  std::vector<char> near_touched_;
  std::vector<int> touched_;
  std::vector<EightSums> merged_;  // by column: a number by own corner
  std::vector<PieceRows> piece_rows_;
  std::vector<int> place_of_piece_;  // in piece_rows_
  std::vector<int> free_places_;
  std::vector<double> sums_;  // by coarse node, of the row it was last met in
  std::vector<int> row_of_sum_;
  std::vector<int> row_columns_;
  std::vector<std::uint64_t> marks_;  // a bit by coarse node, none set between rows
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
