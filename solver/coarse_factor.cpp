#include "solver/coarse_factor.h"

#include <amd.h>

#include <algorithm>
#include <stdexcept>
#include <type_traits>
#include <utility>

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

}  // namespace

/// Columns of a matrix below its diagonal: column k has rows [starts[k], starts[k + 1]).
struct CoarseFactor::BelowDiagonal {
  std::vector<int> starts = {0};
  std::vector<int> rows;
  std::vector<double> values;  ///< empty where only the places are known

  int size() const { return static_cast<int>(starts.size()) - 1; }
  int count(int column) const { return starts[column + 1] - starts[column]; }

  static BelowDiagonal reordered(const SparseMatrix& A, const Eigen::VectorXi& order);
  static BelowDiagonal of_factor(const BelowDiagonal& A);
};

namespace {

/// Which row comes when, so that few entries are filled in. Eigen has an approximate minimum degree of its
/// own, up to five times as slow on the rows of some seventy entries that coarse levels have.
Eigen::VectorXi minimum_degree_order(const SparseMatrix& A) {
  Eigen::VectorXi order(A.rows());
  const int status = amd_order(static_cast<int>(A.rows()), A.outerIndexPtr(), A.innerIndexPtr(), order.data(),
                               nullptr, nullptr);
  if (status != AMD_OK && status != AMD_OK_BUT_JUMBLED)
    throw std::runtime_error("CoarseFactor: no ordering found");
  return order;
}

}  // namespace

/// A with row order[k] as its row k.
CoarseFactor::BelowDiagonal CoarseFactor::BelowDiagonal::reordered(const SparseMatrix& A,
                                                                   const Eigen::VectorXi& order) {
  const int n = static_cast<int>(A.rows());
  Eigen::VectorXi place(n);
  for (int k = 0; k < n; ++k) place[order[k]] = k;
  BelowDiagonal result;
  for (int k = 0; k < n; ++k) {
    for (SparseMatrix::InnerIterator entry(A, order[k]); entry; ++entry) {
      if (place[entry.col()] <= k) continue;
      result.rows.push_back(place[entry.col()]);
      result.values.push_back(entry.value());
    }
    result.starts.push_back(static_cast<int>(result.rows.size()));
  }
  return result;
}

/// Where the factor has entries: a column has those of A and those of all columns whose first entry is in its
/// row [Davis 2006, chapter 4].
CoarseFactor::BelowDiagonal CoarseFactor::BelowDiagonal::of_factor(const BelowDiagonal& A) {
  const int n = A.size();
  BelowDiagonal result;
  std::vector<int> first_child(n, -1), next_sibling(n, -1), met_by(n, -1);
  for (int column = 0; column < n; ++column) {
    const auto meet = [&](int row) {
      if (row <= column || met_by[row] == column) return;
      met_by[row] = column;
      result.rows.push_back(row);
    };
    for (int k = A.starts[column]; k < A.starts[column + 1]; ++k) meet(A.rows[k]);
    for (int child = first_child[column]; child >= 0; child = next_sibling[child])
      for (int k = result.starts[child]; k < result.starts[child + 1]; ++k) meet(result.rows[k]);
    const auto begin = result.rows.begin() + result.starts[column];
    std::sort(begin, result.rows.end());
    if (begin != result.rows.end()) next_sibling[column] = std::exchange(first_child[*begin], column);
    result.starts.push_back(static_cast<int>(result.rows.size()));
  }
  return result;
}

CoarseFactor::CoarseFactor(const SparseMatrix& A) {
  if (A.rows() == 0) return;
  const Eigen::VectorXi order = minimum_degree_order(A);
  order_.assign(order.begin(), order.end());
  const BelowDiagonal ordered = BelowDiagonal::reordered(A, order);
  group_columns(BelowDiagonal::of_factor(ordered));
  Field diagonal(A.rows());
  for (Eigen::Index k = 0; k < A.rows(); ++k) diagonal[k] = A.coeff(order[k], order[k]);
  factorise(ordered, diagonal);
}

// The rows of a column that has the next one among them are rows of that one too, so a group's last column
// has all rows there are. Zeros fill what the others lack.
void CoarseFactor::group_columns(const BelowDiagonal& factor) {
  const int n = factor.size();
  const auto joins = [&](int column) {  // the one before it
    const int count = factor.count(column), before = factor.count(column - 1);
    return before > 0 && factor.rows[factor.starts[column - 1]] == column &&
           count + 1 - before <= kMostZeros + count / kZerosShare;
  };
  std::size_t values = 0;
  for (int first = 0; first < n;) {
    int columns = 1;
    while (columns < kMostColumns && first + columns < n && joins(first + columns)) ++columns;
    groups_.push_back({first, columns, rows_.size(), values});
    const int last = first + columns - 1;
    rows_.insert(rows_.end(), factor.rows.begin() + factor.starts[last],
                 factor.rows.begin() + factor.starts[last + 1]);
    values += columns * (columns - 1) / 2 + static_cast<std::size_t>(columns) * factor.count(last);
    first += columns;
  }
  groups_.push_back({n, 0, rows_.size(), values});
  groups_.shrink_to_fit();
  rows_.shrink_to_fit();
}

// Group after group, each first changed by all groups before it that have rows among its columns
// [Ng, Peyton 1993]: sums over short vectors, a number for each of the group's columns, where a factorisation
// column by column waits for one number after the other.
void CoarseFactor::factorise(const BelowDiagonal& A, const Field& diagonal) {
  using Four = Lanes<kMostColumns>::Double;
  const int n = static_cast<int>(diagonal.size()), group_count = static_cast<int>(groups_.size()) - 1;
  std::vector<double> L(groups_.back().values), pivots(n);
  std::vector<int> group_of(n), place(n, 0);
  std::vector<int> first_source(group_count, -1), next_source(group_count, -1);
  std::vector<std::size_t> next_row(group_count);  // of a group, the first one no later group has had
  std::vector<double> work;                        // kMostColumns a row of the group
  inverse_pivots_.resize(n);
  for (int g = 0; g < group_count; ++g)
    std::fill_n(group_of.begin() + groups_[g].first, groups_[g].columns, g);
  const auto wait_for = [&](int g) {  // until the group of its next row comes
    if (next_row[g] == groups_[g + 1].rows) return;
    const int later = group_of[rows_[next_row[g]]];
    next_source[g] = std::exchange(first_source[later], g);
  };
  for (int g = 0; g < group_count; ++g) {
    const Group& group = groups_[g];
    const int columns = group.columns, behind = group.first + columns;
    const std::size_t row_count = columns + groups_[g + 1].rows - group.rows;
    for (int c = 0; c < columns; ++c) place[group.first + c] = kMostColumns * c;
    for (std::size_t k = group.rows; k < groups_[g + 1].rows; ++k)
      place[rows_[k]] = kMostColumns * static_cast<int>(columns + k - group.rows);
    work.assign(kMostColumns * row_count, 0.0);
    for (int c = 0; c < columns; ++c) {
      const int column = group.first + c;
      // A row of zeros gets some pivot.
      work[place[column] + c] = diagonal[column] > 0 ? (1 + kDiagonalLift) * diagonal[column] : 1.0;
      for (int k = A.starts[column]; k < A.starts[column + 1]; ++k) work[place[A.rows[k]] + c] = A.values[k];
    }

    for (int source = first_source[g]; source >= 0;) {
      const Group& from = groups_[source];
      const double* const below = &L[from.values + from.columns * (from.columns - 1) / 2];
      std::size_t k = next_row[source];
      const std::size_t end = groups_[source + 1].rows, begin = k;
      Four factors[kMostColumns] = {};
      for (; k < end && rows_[k] < behind; ++k)
        for (int c = 0; c < from.columns; ++c)
          factors[c][rows_[k] - group.first] =
              below[from.columns * (k - from.rows) + c] * pivots[from.first + c];
      next_row[source] = k;
      for (k = begin; k < end; ++k) {
        const double* const values = below + from.columns * (k - from.rows);
        double* const row = &work[place[rows_[k]]];
        Four sum = loaded<Four>(row);
        for (int c = 0; c < from.columns; ++c) sum -= values[c] * factors[c];
        store(sum, row);
      }
      wait_for(std::exchange(source, next_source[source]));
    }

    for (int c = 0; c < columns; ++c) {
      const double pivot = work[kMostColumns * c + c];
      const double whole = diagonal[group.first + c];
      const bool rounding = !(whole > 0) || !(pivot > kSmallestPivot * whole);
      // A direction without a correction is eliminated all the same: holding it would hold its neighbors.
      const double inverse = pivot != 0.0 ? 1 / pivot : 0.0;
      pivots[group.first + c] = pivot;
      inverse_pivots_[group.first + c] = rounding ? 0.0f : static_cast<float>(inverse);
      for (std::size_t row = c + 1; row < row_count; ++row) {
        double* const values = &work[kMostColumns * row];
        const double own = std::exchange(values[c], values[c] * inverse);
        for (int other = c + 1; other < columns && other <= static_cast<int>(row); ++other)
          values[other] -= own * work[kMostColumns * other + c];
      }
    }
    double* value = &L[group.values];
    for (int c = 0; c < columns; ++c)
      for (int row = c + 1; row < columns; ++row) *value++ = work[kMostColumns * row + c];
    for (std::size_t row = columns; row < row_count; ++row)
      for (int c = 0; c < columns; ++c) *value++ = work[kMostColumns * row + c];
    next_row[g] = group.rows;
    wait_for(g);
  }
  values_.assign(L.begin(), L.end());
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
