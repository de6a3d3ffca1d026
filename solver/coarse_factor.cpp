#include "solver/coarse_factor.h"

#include <Eigen/SparseCholesky>

namespace sinew {
namespace {

/// Added to the diagonal, relative to it: single-precision entries leave the smallest pivots of a
/// singular matrix uncertain by about this much, and no direction we need is as weak.
constexpr double kDiagonalLift = 1e-7;

/// A pivot below this share of its diagonal is rounding: the direction is spanned by earlier rows.
constexpr double kSmallestPivot = 1e-6;

}  // namespace

CoarseFactor::CoarseFactor(const SparseMatrix& A) {
  using ColumnMatrix = Eigen::SparseMatrix<double>;
  starts_.push_back(0);
  if (A.rows() == 0) return;
  ColumnMatrix lifted = A;
  const Field diagonal = A.diagonal();
  for (Eigen::Index i = 0; i < lifted.rows(); ++i) lifted.coeffRef(i, i) += kDiagonalLift * diagonal[i];
  Eigen::SimplicialLDLT<ColumnMatrix> factor(lifted);
  const auto n = static_cast<std::size_t>(A.rows());
  const ColumnMatrix& L = factor.matrixL().nestedExpression();
  order_.resize(n);
  inverse_pivots_.resize(n);
  for (std::size_t i = 0; i < n; ++i) order_[factor.permutationP().indices()[i]] = static_cast<int>(i);
  for (std::size_t k = 0; k < n; ++k) {
    const double pivot = factor.vectorD()[k];
    inverse_pivots_[k] = pivot > kSmallestPivot * diagonal[order_[k]] ? static_cast<float>(1 / pivot) : 0.0f;
  }
  for (Eigen::Index column = 0; column < L.outerSize(); ++column) {
    for (ColumnMatrix::InnerIterator entry(L, column); entry; ++entry) {
      if (entry.row() <= column) continue;
      rows_.push_back(static_cast<int>(entry.row()));
      values_.push_back(static_cast<float>(entry.value()));
    }
    starts_.push_back(static_cast<int>(rows_.size()));
  }
}

std::size_t CoarseFactor::bytes() const {
  return (order_.size() + starts_.size() + rows_.size()) * sizeof(int) +
         (values_.size() + inverse_pivots_.size()) * sizeof(float);
}

template <int kWidth>
void CoarseFactor::solve(const typename Lanes<kWidth>::Float* b, typename Lanes<kWidth>::Float* x,
                         typename Lanes<kWidth>::Float* scratch) const {
  using Float = typename Lanes<kWidth>::Float;
  const int n = size();
  for (int k = 0; k < n; ++k) scratch[k] = b[order_[k]];
  for (int column = 0; column < n; ++column) {
    const Float known = scratch[column];
    for (int k = starts_[column]; k < starts_[column + 1]; ++k) scratch[rows_[k]] -= values_[k] * known;
  }
  for (int column = n - 1; column >= 0; --column) {
    Float sum = scratch[column] * inverse_pivots_[column];
    for (int k = starts_[column]; k < starts_[column + 1]; ++k) sum -= values_[k] * scratch[rows_[k]];
    scratch[column] = sum;
  }
  for (int k = 0; k < n; ++k) x[order_[k]] = scratch[k];
}

template void CoarseFactor::solve<4>(const Lanes<4>::Float*, Lanes<4>::Float*, Lanes<4>::Float*) const;
template void CoarseFactor::solve<8>(const Lanes<8>::Float*, Lanes<8>::Float*, Lanes<8>::Float*) const;
template void CoarseFactor::solve<16>(const Lanes<16>::Float*, Lanes<16>::Float*, Lanes<16>::Float*) const;

}  // namespace sinew
