#pragma once

#include "solver/hierarchy_levels.h"
#include "solver/lanes.h"

/// Internal to solver/: what a cycle does with the rows of one level.
namespace sinew {

/// The three passes over rows [begin, end) of a level.
template <int kWidth>
struct RowPasses {
  using Float = typename Lanes<kWidth>::Float;
  /// Gauss-Seidel sweeps [Shi et al. 2006, eq. 7], ascending and descending: x_i solves row i.
  void (*forward)(const LevelMatrix& A, const Float* b, Float* x, int begin, int end);
  void (*backward)(const LevelMatrix& A, const Float* b, Float* x, int begin, int end);
  /// r = b - A x.
  void (*residual)(const LevelMatrix& A, const Float* b, const Float* x, Float* r, int begin, int end);
};

/// Those for the way in which `A` keeps its rows.
template <int kWidth>
const RowPasses<kWidth>& row_passes(const LevelMatrix& A);

}  // namespace sinew
