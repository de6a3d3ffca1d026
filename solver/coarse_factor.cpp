#include "solver/coarse_factor.h"

#include <amd.h>

#include <Eigen/SparseCholesky>
#include <algorithm>
#include <stdexcept>
#include <type_traits>

namespace sinew {
namespace {

/// Added to the diagonal, relative to it: single-precision entries leave the smallest pivots of a
/// singular matrix uncertain by about this much, and no direction we need is as weak.
constexpr double kDiagonalLift = 1e-7;

/// A pivot below this share of its diagonal is rounding: the direction is spanned by earlier rows.
constexpr double kSmallestPivot = 1e-6;

/// Zeros that a column takes in to belong to a group: this many, and a share of its entries.
constexpr int kMostZeros = 4;
constexpr int kZerosShare = 8;

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
  if (A.rows() == 0) return;
  // Its rows are its columns: A is symmetric.
  ColumnMatrix lifted = Eigen::Map<const ColumnMatrix>(A.rows(), A.cols(), A.nonZeros(), A.outerIndexPtr(),
                                                       A.innerIndexPtr(), A.valuePtr());
  const Field diagonal = A.diagonal();
  // A row of zeros gets some pivot: the factorisation stops where there is none.
  for (Eigen::Index i = 0; i < lifted.rows(); ++i)
    lifted.coeffRef(i, i) = diagonal[i] > 0 ? (1 + kDiagonalLift) * diagonal[i] : 1.0;
  const Eigen::VectorXi order = minimum_degree_order(lifted);
  const Eigen::PermutationMatrix<Eigen::Dynamic> place_of_row =
      Eigen::PermutationMatrix<Eigen::Dynamic>(order).inverse();
  ColumnMatrix ordered;
  ordered.selfadjointView<Eigen::Lower>() = lifted.selfadjointView<Eigen::Lower>().twistedBy(place_of_row);
  const Eigen::SimplicialLDLT<ColumnMatrix, Eigen::Lower, Eigen::NaturalOrdering<int>> factor(ordered);
  if (factor.info() != Eigen::Success) throw std::runtime_error("CoarseFactor: the matrix has no factor");
  const auto n = static_cast<std::size_t>(A.rows());
  const ColumnMatrix& L = factor.matrixL().nestedExpression();
  order_.assign(order.begin(), order.end());
  inverse_pivots_.resize(n);
  for (std::size_t k = 0; k < n; ++k) {
    const double pivot = factor.vectorD()[k];
    const bool rounding = !(diagonal[order_[k]] > 0) || !(pivot > kSmallestPivot * diagonal[order_[k]]);
    inverse_pivots_[k] = rounding ? 0.0f : static_cast<float>(1 / pivot);
  }
  std::vector<int> starts = {0}, rows;
  std::vector<float> values;
  rows.reserve(static_cast<std::size_t>(L.nonZeros()));
  values.reserve(static_cast<std::size_t>(L.nonZeros()));
  for (Eigen::Index column = 0; column < L.outerSize(); ++column) {
    for (ColumnMatrix::InnerIterator entry(L, column); entry; ++entry) {
      if (entry.row() <= column) continue;
      rows.push_back(static_cast<int>(entry.row()));
      values.push_back(static_cast<float>(entry.value()));
    }
    starts.push_back(static_cast<int>(rows.size()));
  }
  group_columns(starts, rows, values);
}

// The rows of a column that has the next one among them are rows of that one too, so a group's last column
// has all rows there are. Zeros fill what the others lack.
void CoarseFactor::group_columns(const std::vector<int>& starts, const std::vector<int>& rows,
                                 const std::vector<float>& values) {
  const int n = size();
  const auto count = [&](int column) { return starts[column + 1] - starts[column]; };
  const auto joins = [&](int column) {  // the one before it
    return count(column - 1) > 0 && rows[starts[column - 1]] == column &&
           count(column) + 1 - count(column - 1) <= kMostZeros + count(column) / kZerosShare;
  };
  for (int first = 0; first < n;) {
    int columns = 1;
    while (columns < kMostColumns && first + columns < n && joins(first + columns)) ++columns;
    groups_.push_back({first, columns, rows_.size(), values_.size()});
    const int last = first + columns - 1;
    rows_.insert(rows_.end(), rows.begin() + starts[last], rows.begin() + starts[last + 1]);
    const std::size_t inside = values_.size();
    values_.resize(inside + columns * (columns - 1) / 2 + static_cast<std::size_t>(columns) * count(last));
    float* value = values_.data() + inside;
    for (int column = first; column < last; ++column) {
      int k = starts[column];
      for (int row = column + 1; row <= last; ++row)
        *value++ = k < starts[column + 1] && rows[k] == row ? values[k++] : 0.0f;
    }
    for (int column = first; column <= last; ++column) {
      int k = static_cast<int>(
          std::lower_bound(rows.begin() + starts[column], rows.begin() + starts[column + 1], last + 1) -
          rows.begin());
      for (int row = 0; k < starts[column + 1]; ++row)
        if (rows[starts[last] + row] == rows[k]) value[columns * row + column - first] = values[k++];
    }
    first += columns;
  }
  groups_.push_back({n, 0, rows_.size(), values_.size()});
  groups_.shrink_to_fit();
  rows_.shrink_to_fit();
  values_.shrink_to_fit();
}

std::size_t CoarseFactor::bytes() const {
  return (order_.size() + rows_.size()) * sizeof(int) + groups_.size() * sizeof(Group) +
         (values_.size() + inverse_pivots_.size()) * sizeof(float);
}

// Everything below the group takes off what its columns know.
template <int kWidth, int kColumns>
void CoarseFactor::go_down(const Group& group, std::size_t rows_end, typename Lanes<kWidth>::Float* x) const {
  using Float = typename Lanes<kWidth>::Float;
  const float* value = values_.data() + group.values;
  Float known[kColumns];
  for (int c = 0; c < kColumns; ++c) known[c] = x[group.first + c];
  for (int c = 0; c < kColumns; ++c)
    for (int row = c + 1; row < kColumns; ++row) known[row] -= *value++ * known[c];
  for (int c = 0; c < kColumns; ++c) x[group.first + c] = known[c];
  for (std::size_t k = group.rows; k < rows_end; ++k, value += kColumns) {
    Float& below = x[rows_[k]];
    Float sum = value[0] * known[0];
    for (int c = 1; c < kColumns; ++c) sum += value[c] * known[c];
    below -= sum;
  }
}

// The group's columns take off what is known below them. Two running sums each, so that an addition need not
// wait for the one before it.
template <int kWidth, int kColumns>
void CoarseFactor::come_up(const Group& group, std::size_t rows_end, typename Lanes<kWidth>::Float* x) const {
  using Float = typename Lanes<kWidth>::Float;
  constexpr int kInside = kColumns * (kColumns - 1) / 2;
  const float* const inside = values_.data() + group.values;
  const float* value = inside + kInside;
  Float even[kColumns] = {}, odd[kColumns] = {};
  std::size_t k = group.rows;
  for (; k + 1 < rows_end; k += 2, value += 2 * kColumns) {
    const Float first = x[rows_[k]], second = x[rows_[k + 1]];
    for (int c = 0; c < kColumns; ++c) {
      even[c] += value[c] * first;
      odd[c] += value[kColumns + c] * second;
    }
  }
  if (k < rows_end)
    for (int c = 0; c < kColumns; ++c) even[c] += value[c] * x[rows_[k]];
  int entry = kInside;
  for (int c = kColumns - 1; c >= 0; --c) {
    Float sum = x[group.first + c] * inverse_pivots_[group.first + c] - (even[c] + odd[c]);
    for (int row = kColumns - 1; row > c; --row) sum -= inside[--entry] * x[group.first + row];
    x[group.first + c] = sum;
  }
}

template <int kWidth>
void CoarseFactor::solve(const typename Lanes<kWidth>::Float* b, typename Lanes<kWidth>::Float* x,
                         typename Lanes<kWidth>::Float* scratch) const {
  const int n = size();
  for (int k = 0; k < n; ++k) scratch[k] = b[order_[k]];
  const auto with_columns = [](int columns, const auto& body) {
    if (columns == 1) return body(std::integral_constant<int, 1>{});
    if (columns == 2) return body(std::integral_constant<int, 2>{});
    if (columns == 3) return body(std::integral_constant<int, 3>{});
    body(std::integral_constant<int, kMostColumns>{});
  };
  const int group_count = static_cast<int>(groups_.size()) - 1;
  for (int k = 0; k < group_count; ++k)
    with_columns(groups_[k].columns,
                 [&](auto columns) { go_down<kWidth, columns>(groups_[k], groups_[k + 1].rows, scratch); });
  for (int k = group_count - 1; k >= 0; --k)
    with_columns(groups_[k].columns,
                 [&](auto columns) { come_up<kWidth, columns>(groups_[k], groups_[k + 1].rows, scratch); });
  for (int k = 0; k < n; ++k) x[order_[k]] = scratch[k];
}

template void CoarseFactor::solve<4>(const Lanes<4>::Float*, Lanes<4>::Float*, Lanes<4>::Float*) const;
template void CoarseFactor::solve<8>(const Lanes<8>::Float*, Lanes<8>::Float*, Lanes<8>::Float*) const;
template void CoarseFactor::solve<16>(const Lanes<16>::Float*, Lanes<16>::Float*, Lanes<16>::Float*) const;

}  // namespace sinew
