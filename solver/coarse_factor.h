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
  /// get no correction.
  explicit CoarseFactor(const SparseMatrix& A);

  int size() const { return static_cast<int>(inverse_pivots_.size()); }
  std::size_t bytes() const;
  std::int64_t entries() const { return static_cast<std::int64_t>(values_.size()); }  ///< below the diagonal

  /// x = A^-1 b; `scratch` holds size() rows. b and x may be the same.
  template <int kWidth>
  void solve(const typename Lanes<kWidth>::Float* b, typename Lanes<kWidth>::Float* x,
             typename Lanes<kWidth>::Float* scratch) const;

 private:
  std::vector<int> order_;   // row k of the factor is row order_[k] of A
  std::vector<int> starts_;  // strictly lower triangle of L, column after column
  std::vector<int> rows_;
  std::vector<float> values_;
  std::vector<float> inverse_pivots_;
};

}  // namespace sinew
