#include "solver/coarse_factor.h"

#include <amd.h>

#include <Eigen/SparseCholesky>
#include <stdexcept>

namespace sinew {
namespace {

/// Added to the diagonal, relative to it: single-precision entries leave the smallest pivots of a
/// singular matrix uncertain by about this much, and no direction we need is as weak.
constexpr double kDiagonalLift = 1e-7;

/// A pivot below this share of its diagonal is rounding: the direction is spanned by earlier rows.
constexpr double kSmallestPivot = 1e-6;

using ColumnMatrix = Eigen::SparseMatrix<double>;

/// Which row comes when, so that few entries are filled in. Eigen has an approximate minimum degree of its
/// own, up to five times as slow on the rows of some seventy entries that coarse levels have.
Eigen::VectorXi minimum_degree_order(const ColumnMatrix& A) {
  Eigen::VectorXi order(A.rows());
  const int status = amd_order(static_cast<int>(A.rows()), A.outerIndexPtr(), A.innerIndexPtr(), order.data(),
                               nullptr, nullptr);
  if (status != AMD_OK && status != AMD_OK_BUT_JUMBLED)
    throw std::runtime_error("CoarseFactor: no ordering found");
  return order;
}

}  // namespace

CoarseFactor::CoarseFactor(const SparseMatrix& A) {
  starts_.push_back(0);
  if (A.rows() == 0) return;
  // Its rows are its columns: A is symmetric.
  ColumnMatrix lifted = Eigen::Map<const ColumnMatrix>(A.rows(), A.cols(), A.nonZeros(), A.outerIndexPtr(),
                                                       A.innerIndexPtr(), A.valuePtr());
  const Field diagonal = A.diagonal();
  for (Eigen::Index i = 0; i < lifted.rows(); ++i) lifted.coeffRef(i, i) += kDiagonalLift * diagonal[i];
  const Eigen::VectorXi order = minimum_degree_order(lifted);
  const Eigen::PermutationMatrix<Eigen::Dynamic> place_of_row =
      Eigen::PermutationMatrix<Eigen::Dynamic>(order).inverse();
  ColumnMatrix ordered;
  ordered.selfadjointView<Eigen::Lower>() = lifted.selfadjointView<Eigen::Lower>().twistedBy(place_of_row);
  const Eigen::SimplicialLDLT<ColumnMatrix, Eigen::Lower, Eigen::NaturalOrdering<int>> factor(ordered);
  const auto n = static_cast<std::size_t>(A.rows());
  const ColumnMatrix& L = factor.matrixL().nestedExpression();
  order_.assign(order.begin(), order.end());
  inverse_pivots_.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    const double pivot = factor.vectorD()[k];
    inverse_pivots_[k] = pivot > kSmallestPivot * diagonal[order_[k]] ? static_cast<float>(1 / pivot) : 0.0f;
  }
  rows_.reserve(static_cast<std::size_t>(L.nonZeros()));
  values_.reserve(static_cast<std::size_t>(L.nonZeros()));
  starts_.reserve(n + 1);
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
