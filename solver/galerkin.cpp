#include "solver/galerkin.h"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <span>
#include <utility>

#include "solver/lattice_coarsening.h"
#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

constexpr int kCorners = 8;

/// Coarse rows made in one go, at least. A slab recomputes what it shares with the one before it at its
/// beginning, so it should be long against a front of coarse nodes.
constexpr int kFewestSlabRows = 256;

constexpr int kWord = 64;

// Rows come out the same however they are cut, so the cut may look at the team.
int slab_count(int rows, const ThreadTeam& team) {
  return std::clamp(rows / kFewestSlabRows, 1, team.thread_count());
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
  struct Place {
    int piece = 0;
    int entry = 0;  // of PieceTransfer::nodes
  };

  LargeVector<Place> places;   // by fine node
  LargeVector<float> weights;  // kCorners an entry: those of a piece lie side by side

  const float* weights_of(int entry) const { return &weights[kCorners * static_cast<std::size_t>(entry)]; }
};

FineNodes by_fine_node(const PieceTransfer& transfer, ThreadTeam& team) {
  constexpr int fewest_pieces = 512;
  FineNodes fine;
  fine.places.resize(transfer.nodes.size());
  fine.weights.resize(kCorners * transfer.nodes.size());
  for_items(team, transfer.piece_count(), fewest_pieces, [&](int p) {
    for (int entry = transfer.piece_offsets[p]; entry < transfer.piece_offsets[p + 1]; ++entry) {
      fine.places[transfer.nodes[entry]] = {p, entry};
      trilinear_weights(&transfer.places[3 * static_cast<std::size_t>(entry)],
                        &fine.weights[kCorners * static_cast<std::size_t>(entry)]);
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
  // By global number; -1 for those not met.
  const int* table() const { return local_.data(); }
  const std::vector<int>& met() const { return met_; }
  void clear() {
    for (int global : met_) local_[global] = -1;
    met_.clear();
  }

 private:
  std::vector<int> local_;
  std::vector<int> met_;
};

// Some of the coarse nodes kWord * number and those behind it.
struct WordOfColumns {
  int number = 0;
  std::uint64_t bits = 0;
};

// What one piece contributes to the coarse rows of its eight corners.
struct PieceRows {
  std::vector<int> columns;          // coarse nodes
  std::vector<WordOfColumns> words;  // the same
  std::vector<double> values;        // kCorners x columns, row after row
};

// A set of coarse nodes that is cheap to unite with others and to list in order.
class ColumnSet {
 public:
  explicit ColumnSet(int count) : bits_(static_cast<std::size_t>(count) / kWord + 1, 0) {}

  void add(const WordOfColumns& word) {
    if (bits_[word.number] == 0) met_.push_back(word.number);
    bits_[word.number] |= word.bits;
  }
  void add(int column) { add({column / kWord, std::uint64_t{1} << (column % kWord)}); }

  // All of it, ascending, as words. Leaves it empty.
  void take(std::vector<WordOfColumns>& words) {
    std::sort(met_.begin(), met_.end());
    words.clear();
    for (const int number : met_) words.push_back({number, std::exchange(bits_[number], 0)});
    met_.clear();
  }

  // All of it, ascending. Leaves it empty. Most words have a few bits: so many are written without asking,
  // and those behind the last are overwritten.
  std::span<const int> take() {
    constexpr int unasked = 4;
    std::sort(met_.begin(), met_.end());
    listed_.resize(std::max(listed_.size(), kWord * met_.size() + unasked));
    int* next = listed_.data();
    for (const int number : met_) {
      std::uint64_t left = std::exchange(bits_[number], 0);
      int* const end = next + std::popcount(left);
      for (int k = 0; k < unasked; ++k, left &= left - 1) next[k] = kWord * number + std::countr_zero(left);
      for (next += unasked; next < end; left &= left - 1) *next++ = kWord * number + std::countr_zero(left);
      next = end;
    }
    met_.clear();
    return {listed_.data(), next};
  }

 private:
  std::vector<std::uint64_t> bits_;
  std::vector<int> met_;  // words that are not zero
  std::vector<int> listed_;
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
        sums_(static_cast<std::size_t>(transfer.coarse_count), 0.0),
        piece_columns_(transfer.coarse_count),
        row_columns_(transfer.coarse_count) {}

  // Rows [begin, end) of the product, with offsets counted from this slab's first entry.
  LevelMatrix rows(int begin, int end) {
    LevelMatrix result;
    for (int row = begin; row < end; ++row) append_row(row, result);
    return result;
  }

 private:
  // Numbers a piece among those that the piece in hand is joined to.
  int meet(int piece) {
    const int near = near_(piece);
    near_sums_.resize(near_.met().size());
    blocks_.resize(near_.met().size());
    touched_.resize(near_.met().size() / kWord + 1, 0);
    return near;
  }

  // One fine node's row of A P, by near piece. All pointers are read once: what is written here might be any
  // number, as far as the compiler knows.
  void sum_neighbors(int node, const float* own_weights) {
    const int *const near_of_piece = near_.table(), *const neighbors = A_.neighbors.data();
    const FineNodes::Place* const places = fine_.places.data();
    const float *const weights = fine_.weights.data(), *const factors =
                                                           A_.weights.empty() ? nullptr : A_.weights.data();
    const double uniform = A_.uniform_weight;
    EightSums* sums = near_sums_.data();
    std::uint64_t* touched = touched_.data();
    sums[0].add(A_.diagonal[node], own_weights);
    touched[0] |= 1;
    const int end = A_.offsets[node + 1];
    for (int k = A_.offsets[node]; k < end; ++k) {
      const FineNodes::Place place = places[neighbors[k]];
      int near = near_of_piece[place.piece];
      if (near < 0) {
        near = meet(place.piece);
        sums = near_sums_.data();
        touched = touched_.data();
      }
      touched[static_cast<unsigned>(near) / kWord] |= std::uint64_t{1} << (near & (kWord - 1));
      sums[near].add(factors != nullptr ? -static_cast<double>(factors[k]) : -uniform,
                     weights + static_cast<std::size_t>(kCorners) * place.entry);
    }
  }

  // That row, times the node's weights: one block of eight by eight per piece it is joined to.
  void add_node(int entry) {
    const float* const own_weights = fine_.weights_of(entry);
    sum_neighbors(transfer_.nodes[entry], own_weights);
    const auto weights = converted<double, kCorners>(loaded<Eight::Float>(own_weights));
    EightSums* const sums = near_sums_.data();
    Block* const blocks = blocks_.data();
    for (std::size_t word = 0; word < touched_.size(); ++word) {
      for (std::uint64_t left = std::exchange(touched_[word], 0); left != 0; left &= left - 1) {
        const std::size_t near = kWord * word + static_cast<std::size_t>(std::countr_zero(left));
        const Eight::Double own = std::exchange(sums[near], {}).value;
        for (int corner = 0; corner < kCorners; ++corner)
          blocks[near].columns[corner] += own[corner] * weights;
      }
    }
  }

  // The rows of P^T (A P) that the nodes of one piece give to its eight corners.
  void fill_piece(int piece, PieceRows& out) {
    meet(piece);
    for (int entry = transfer_.piece_offsets[piece]; entry < transfer_.piece_offsets[piece + 1]; ++entry)
      add_node(entry);
    merged_.clear();
    for (std::size_t near = 0; near < near_.met().size(); ++near) {
      const int* const corners = &transfer_.corners[static_cast<std::size_t>(kCorners) * near_.met()[near]];
      for (int corner = 0; corner < kCorners; ++corner) {
        const auto column = static_cast<std::size_t>(columns_(corners[corner]));
        if (column == merged_.size()) merged_.emplace_back();
        merged_[column].value += blocks_[near].columns[corner];
      }
    }
    write_rows(out);
    columns_.clear();
    near_.clear();
    near_sums_.clear();
    blocks_.clear();
  }

  void write_rows(PieceRows& out) {
    out.columns = columns_.met();
    const std::size_t width = out.columns.size();
    out.values.resize(kCorners * width);
    for (std::size_t column = 0; column < width; ++column) {
      for (int corner = 0; corner < kCorners; ++corner)
        out.values[corner * width + column] = merged_[column].value[corner];
    }
    // What is read of a corner that is none is zero, and may be added anywhere.
    for (int& column : out.columns) column = std::min(column, transfer_.coarse_count - 1);
    for (const int column : out.columns) piece_columns_.add(column);
    piece_columns_.take(out.words);
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
    for (int use = transfer_.use_offsets[row]; use < transfer_.use_offsets[row + 1]; ++use)
      add_piece_row(rows_of(transfer_.uses[use] / kCorners), transfer_.uses[use] % kCorners);
    for (int use = transfer_.use_offsets[row]; use < transfer_.use_offsets[row + 1]; ++use)
      leave(transfer_.uses[use] / kCorners, row);
    const std::span<const int> columns = row_columns_.take();
    std::size_t end = result.neighbors.size();
    result.neighbors.resize(end + columns.size());
    result.weights.resize(end + columns.size());
    float diagonal = 0.0f;
    for (const int column : columns) {
      const auto value = static_cast<float>(std::exchange(sums_[column], 0.0));
      result.neighbors[end] = column;
      result.weights[end] = -value;
      if (column == row) diagonal = value;
      end += column != row && value != 0.0f ? 1 : 0;
    }
    result.neighbors.resize(end);
    result.weights.resize(end);
    result.diagonal.push_back(diagonal);
    result.offsets.push_back(static_cast<int>(end));
  }

  void add_piece_row(const PieceRows& rows, int corner) {
    const std::size_t width = rows.columns.size();
    const double* const values = &rows.values[corner * width];
    const int* const columns = rows.columns.data();
    double* const sums = sums_.data();
    for (std::size_t k = 0; k < width; ++k) sums[columns[k]] += values[k];
    for (const WordOfColumns& word : rows.words) row_columns_.add(word);
  }

  const LevelMatrix& A_;
  const PieceTransfer& transfer_;
  const FineNodes& fine_;
  LocalNumbers near_;                   // pieces that one piece is joined to
  LocalNumbers columns_;                // coarse nodes
  std::vector<EightSums> near_sums_;    // by near piece: what the current fine node reads of its corners
  std::vector<std::uint64_t> touched_;  // near pieces whose sums are not zero
  std::vector<Block> blocks_;           // by near piece
  std::vector<EightSums> merged_;       // by column: a number by own corner
  std::vector<PieceRows> piece_rows_;
  std::vector<int> place_of_piece_;  // in piece_rows_
  std::vector<int> free_places_;
  std::vector<double> sums_;  // by coarse node, zero between rows
  ColumnSet piece_columns_;   // empty between pieces
  ColumnSet row_columns_;     // empty between rows
};

void append(const LevelMatrix& part, LevelMatrix& whole) {
  const int base = static_cast<int>(whole.neighbors.size());
  whole.neighbors.insert(whole.neighbors.end(), part.neighbors.begin(), part.neighbors.end());
  whole.weights.insert(whole.weights.end(), part.weights.begin(), part.weights.end());
  whole.diagonal.insert(whole.diagonal.end(), part.diagonal.begin(), part.diagonal.end());
  for (std::size_t i = 1; i < part.offsets.size(); ++i) whole.offsets.push_back(base + part.offsets[i]);
}

// uniform_weight in place of weights that are all the same.
void drop_equal_weights(LevelMatrix& matrix) {
  LargeVector<float>& weights = matrix.weights;
  if (!weights.empty() &&
      std::all_of(weights.begin(), weights.end(), [&](float w) { return w == weights.front(); })) {
    matrix.uniform_weight = weights.front();
    LargeVector<float>().swap(weights);  // gives the memory back, which clearing would not
  }
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
  drop_equal_weights(product);
  finish_level(product);
  return product;
}

void finish_level(LevelMatrix& matrix) {
  matrix.inverse_diagonal.resize(matrix.diagonal.size());
  // A row without a diagonal is an equation 0 = 0: its correction stays zero.
  for (std::size_t i = 0; i < matrix.diagonal.size(); ++i)
    matrix.inverse_diagonal[i] = matrix.diagonal[i] > 0 ? 1 / matrix.diagonal[i] : 0.0f;
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
