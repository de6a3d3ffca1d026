#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "solver/lanes.h"
#include "solver/laplacian.h"

/// Internal to solver/.
namespace sinew {

/// Sparse factorisation P^T L D L^T P of the coarsest matrix, factored in double, kept and applied in
/// single precision for several right-hand sides at once: a preconditioner needs no more.
class CoarseFactor {
 public:
  CoarseFactor() = default;  ///< of nothing
  /// `A` symmetric. Directions in which A is zero to rounding (coarse nodes that repeat one another)
  /// get no correction, rows of zeros among them. Throws std::runtime_error when no ordering is found.
  explicit CoarseFactor(const SparseMatrix& A);

  int size() const { return static_cast<int>(inverse_pivots_.size()); }
  std::size_t bytes() const;
  /// Below the diagonal, with some that are zero.
  std::int64_t entries() const { return static_cast<std::int64_t>(values_.size()); }

  /// x = A^-1 b; `scratch` holds size() rows. b and x may be the same.
  template <int kWidth>
  void solve(const typename Lanes<kWidth>::Float* b, typename Lanes<kWidth>::Float* x,
             typename Lanes<kWidth>::Float* scratch) const;

 private:
  /// Columns that follow one another and have entries in the same rows below themselves: what a row holds is
  /// read once for all of them.
  struct Group {
    int first = 0;           ///< column
    int columns = 0;         ///< 1 to kMostColumns
    std::size_t rows = 0;    ///< from there on in rows_, up to the next group's
    std::size_t values = 0;  ///< likewise: those among the columns, column by column, then `columns` a row
  };
  static constexpr int kMostColumns = 4;

  struct BelowDiagonal;
  /// Groups of the columns that have entries in these places.
  void group_columns(const BelowDiagonal& factor);
  /// The values of the groups for a matrix with these entries below its diagonal.
  void factorise(const BelowDiagonal& A, const Field& diagonal);
  template <int kWidth, int kColumns>
  void go_down(const Group& group, std::size_t rows_end, typename Lanes<kWidth>::Float* x) const;
  template <int kWidth, int kColumns>
  void come_up(const Group& group, std::size_t rows_end, typename Lanes<kWidth>::Float* x) const;

  std::vector<int> order_;     // row k of the factor is row order_[k] of A
  std::vector<Group> groups_;  // of the columns of L, and one more behind the last
  std::vector<int> rows_;
  std::vector<float> values_;
  std::vector<float> inverse_pivots_;
};

}  // namespace sinew
