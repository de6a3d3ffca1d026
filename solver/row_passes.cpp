// Gauss-Seidel sweeps and residuals [Shi et al. 2006, eq. 7], row by row: what one row needs of the row
// before it must not wait for anything else.
#include "solver/row_passes.h"

#include <cstdint>

namespace sinew {
namespace {

// Sum of the weighted neighbors of node i. Two running sums, so that an addition need not wait for the one
// before it. From the last neighbor to the first where `kStep` is -1: rows that come in descending order are
// then one stream of memory, which the processor foresees.
template <int kWidth, int kStep>
inline typename Lanes<kWidth>::Float neighbor_sum(const LevelMatrix& A,
                                                  const typename Lanes<kWidth>::Float* x, int i) {
  typename Lanes<kWidth>::Float even{}, odd{};
  const int* const neighbors = A.neighbors.data();
  const float* const weights = A.weights.data();
  const int begin = A.offsets[i], end = A.offsets[i + 1];
  int k = kStep > 0 ? begin : end - 1, left = end - begin;
  for (; left > 1; left -= 2, k += 2 * kStep) {
    even += weights[k] * x[neighbors[k]];
    odd += weights[k + kStep] * x[neighbors[k + kStep]];
  }
  if (left > 0) even += weights[k] * x[neighbors[k]];
  return even + odd;
}

// The same for weights that are all one number and not even stored.
template <int kWidth>
inline typename Lanes<kWidth>::Float plain_neighbor_sum(const LevelMatrix& A,
                                                        const typename Lanes<kWidth>::Float* x, int i) {
  typename Lanes<kWidth>::Float sum{};
  for (int k = A.offsets[i]; k < A.offsets[i + 1]; ++k) sum += x[A.neighbors[k]];
  return sum * A.uniform_weight;
}

// The row's own value and its first neighbors but the one in `kSlot`; `x` points at the row itself. Four
// running sums.
template <int kWidth, int kSlot, typename Step>
inline typename Lanes<kWidth>::Float short_row_sum(const ShortRow<Step>& row,
                                                   const typename Lanes<kWidth>::Float* x) {
  typename Lanes<kWidth>::Float s0 = row.at(x, 1 - kSlot), s1 = row.at(x, 2), s2 = row.at(x, 3),
                                s3 = row.at(x, 4);
  s0 += row.at(x, 5);
  s1 += row.at(x, 6);
  s2 += row.at(x, 7);
  s3 += row.at(x, 8);
  s0 += row.at(x, 9);
  s1 += row.at(x, 10);
  s2 += row.at(x, 11);
  s3 += row.at(x, 12);
  s0 += row.at(x, 13);
  s1 += row.own * x[0];
  return (s0 + s1) + (s2 + s3);
}

template <int kWidth>
inline typename Lanes<kWidth>::Float rest_sum(const ShortRows& rows, int long_row,
                                              const typename Lanes<kWidth>::Float* x) {
  typename Lanes<kWidth>::Float s0{}, s1{}, s2{}, s3{};
  const int* const rest = rows.rest.data();
  for (int k = rows.rest_offsets[long_row]; k < rows.rest_offsets[long_row + 1]; k += kRestGroup) {
    s0 += x[rest[k]];
    s1 += x[rest[k + 1]];
    s2 += x[rest[k + 2]];
    s3 += x[rest[k + 3]];
  }
  return (s0 + s1) + (s2 + s3);
}

// Rows [begin, end) outside runs, with `before` rows of runs before them.
struct LooseRows {
  int begin, end, before;
};

// Calls visit(i, sum, last) for these rows, ascending: the neighbors' sum but for the value of the one in
// `kSlot`, and that value. `long_row`: the next one among the long rows.
template <int kWidth, int kSlot, typename Step, typename Visit>
inline void ascend(const ShortRows& short_rows, const LargeVector<ShortRow<Step>>& rows,
                   const typename Lanes<kWidth>::Float* x, const LooseRows& loose, int& long_row,
                   const Visit& visit) {
  const LargeVector<int>& long_rows = short_rows.long_rows;
  const int end = loose.end, before = loose.before;
  const ShortRow<Step>* const row = rows.data();
  for (int i = loose.begin; i < end; ++i) {
    const bool is_long = long_row < static_cast<int>(long_rows.size()) && long_rows[long_row] < end;
    const int stop = is_long ? long_rows[long_row] : end;
    for (; i < stop; ++i)
      visit(i, short_row_sum<kWidth, kSlot>(row[i - before], x + i), row[i - before].at(x + i, kSlot));
    if (!is_long) return;
    visit(i, short_row_sum<kWidth, kSlot>(row[i - before], x + i) + rest_sum<kWidth>(short_rows, long_row, x),
          row[i - before].at(x + i, kSlot));
    ++long_row;
  }
}

// The same, descending. `long_row`: the one before which none is left.
template <int kWidth, int kSlot, typename Step, typename Visit>
inline void come_down(const ShortRows& short_rows, const LargeVector<ShortRow<Step>>& rows,
                      const typename Lanes<kWidth>::Float* x, const LooseRows& loose, int& long_row,
                      const Visit& visit) {
  const LargeVector<int>& long_rows = short_rows.long_rows;
  const int begin = loose.begin, before = loose.before;
  const ShortRow<Step>* const row = rows.data();
  for (int i = loose.end - 1; i >= begin; --i) {
    const bool is_long = long_row >= 0 && long_rows[long_row] >= begin;
    const int stop = is_long ? long_rows[long_row] : begin - 1;
    for (; i > stop; --i)
      visit(i, short_row_sum<kWidth, kSlot>(row[i - before], x + i), row[i - before].at(x + i, kSlot));
    if (!is_long) return;
    visit(i, short_row_sum<kWidth, kSlot>(row[i - before], x + i) + rest_sum<kWidth>(short_rows, long_row, x),
          row[i - before].at(x + i, kSlot));
    --long_row;
  }
}

template <typename Step>
const LargeVector<ShortRow<Step>>& rows_with(const ShortRows& rows) {
  if constexpr (sizeof(Step) == sizeof(std::int16_t))
    return rows.near;
  else
    return rows.far;
}

/// Passes over ShortRows.
template <int kWidth, typename Step>
struct ShortPasses {
  using Float = typename Lanes<kWidth>::Float;

  static void forward(const LevelMatrix& A, const Float* b, Float* x, int begin, int end) {
    const ShortRows& rows = A.short_rows;
    int long_row = rows.first_long_from(begin);
    ascend_parts(
        rows.runs, begin, end,
        [&](int first, int last, int before) {
          ascend<kWidth, kBefore>(rows, rows_with<Step>(rows), x, {first, last, before}, long_row,
                                  relaxation(A, b, x));
        },
        [&](const LatticeRun& run, int first, int last) { relax_run<1>(A, run, b, x, first, last); });
  }
  static void backward(const LevelMatrix& A, const Float* b, Float* x, int begin, int end) {
    const ShortRows& rows = A.short_rows;
    int long_row = rows.first_long_from(end) - 1;
    descend_parts(
        rows.runs, begin, end,
        [&](int first, int last, int before) {
          come_down<kWidth, kAfter>(rows, rows_with<Step>(rows), x, {first, last, before}, long_row,
                                    relaxation(A, b, x));
        },
        [&](const LatticeRun& run, int first, int last) { relax_run<-1>(A, run, b, x, first, last); });
  }
  static void residual(const LevelMatrix& A, const Float* b, const Float* x, Float* r, int begin, int end) {
    const ShortRows& rows = A.short_rows;
    const float* const diagonal = A.diagonal.data();
    const float weight = A.uniform_weight;
    int long_row = rows.first_long_from(begin);
    ascend_parts(
        rows.runs, begin, end,
        [&](int first, int last, int before) {
          ascend<kWidth, kBefore>(rows, rows_with<Step>(rows), x, {first, last, before}, long_row,
                                  [=](int i, const Float& sum, const Float& other) {
                                    r[i] = b[i] - diagonal[i] * x[i] + (sum + other) * weight;
                                  });
        },
        [&](const LatticeRun& run, int first, int last) {
          const float own = diagonal[first];
          along_run<1>(run, first, last, values_of(x), [=](int i, const Float& pairs, const Float& singles) {
            r[i] = b[i] - own * x[i] + (pairs + (singles + (x[i - 1] + x[i + 1]))) * weight;
          });
        });
  }

 private:
  static auto values_of(const Float* x) {
    return [=](int i) { return x[i]; };
  }

  // All that does not need the row before is done before it is asked for.
  static auto relaxation(const LevelMatrix& A, const Float* b, Float* x) {
    const float* const inverse = A.inverse_diagonal.data();
    const float weight = A.uniform_weight;
    return [=](int i, const Float& sum, const Float& last) {
      const float share = weight * inverse[i];
      x[i] = (b[i] * inverse[i] + sum * share) + last * share;
    };
  }

  // The row before never leaves its register.
  template <int kStep>
  static void relax_run(const LevelMatrix& A, const LatticeRun& run, const Float* b, Float* x, int begin,
                        int end) {
    const float inverse = A.inverse_diagonal[begin], share = A.uniform_weight * inverse;
    Float last = kStep > 0 ? x[begin - 1] : x[end];
    along_run<kStep>(run, begin, end, values_of(x), [&](int i, const Float& pairs, const Float& singles) {
      last = (b[i] * inverse + (pairs + (singles + x[i + kStep])) * share) + last * share;
      x[i] = last;
    });
  }
};

/// Passes along lists of neighbors.
template <int kWidth, bool kUniform>
struct ListPasses {
  using Float = typename Lanes<kWidth>::Float;

  template <int kStep>
  static Float sum(const LevelMatrix& A, const Float* x, int i) {
    return kUniform ? plain_neighbor_sum<kWidth>(A, x, i) : neighbor_sum<kWidth, kStep>(A, x, i);
  }
  static void forward(const LevelMatrix& A, const Float* b, Float* x, int begin, int end) {
    const float* const inverse = A.inverse_diagonal.data();
    for (int i = begin; i < end; ++i) x[i] = (b[i] + sum<1>(A, x, i)) * inverse[i];
  }
  static void backward(const LevelMatrix& A, const Float* b, Float* x, int begin, int end) {
    const float* const inverse = A.inverse_diagonal.data();
    for (int i = end - 1; i >= begin; --i) x[i] = (b[i] + sum<-1>(A, x, i)) * inverse[i];
  }
  static void residual(const LevelMatrix& A, const Float* b, const Float* x, Float* r, int begin, int end) {
    const float* const diagonal = A.diagonal.data();
    for (int i = begin; i < end; ++i) r[i] = b[i] - diagonal[i] * x[i] + sum<1>(A, x, i);
  }
};

template <int kWidth, typename Passes>
constexpr RowPasses<kWidth> kPassesOf = {Passes::forward, Passes::backward, Passes::residual};

}  // namespace

template <int kWidth>
const RowPasses<kWidth>& row_passes(const LevelMatrix& A) {
  if (!A.short_rows.far.empty()) return kPassesOf<kWidth, ShortPasses<kWidth, std::int32_t>>;
  if (!A.short_rows.empty()) return kPassesOf<kWidth, ShortPasses<kWidth, std::int16_t>>;
  if (A.weights.empty()) return kPassesOf<kWidth, ListPasses<kWidth, true>>;
  return kPassesOf<kWidth, ListPasses<kWidth, false>>;
}

template const RowPasses<4>& row_passes<4>(const LevelMatrix&);
template const RowPasses<8>& row_passes<8>(const LevelMatrix&);
template const RowPasses<16>& row_passes<16>(const LevelMatrix&);

}  // namespace sinew
