#pragma once

#include <vector>

#include "solver/hierarchy_levels.h"
#include "solver/lanes.h"
#include "solver/thread_team.h"

/// Internal to solver/: one multigrid cycle in single precision.
namespace sinew {

/// Sweeps that stand in for a direct solve when the last level is too large to factor: forward, and as many
/// backward.
constexpr int kLastLevelSweeps = 20;

/// Sweeps forward, and as many backward, that finish full multigrid where finished_by_smoothing.
constexpr int kFinishingSweeps = 2;

/// Whether full multigrid merely smooths `level`: the finest one, when it is reached by linear interpolation.
bool finished_by_smoothing(const Hierarchy::Members& hierarchy, int level);

/// Sweeps before and after the coarse correction of `level` when the finest level has `sweeps`: half as many
/// where the matrix is a Galerkin product, whose coarse corrections are good enough to be worth little
/// polish.
int sweeps_on_level(const Hierarchy::Members& hierarchy, int level, int sweeps);

/// Arrays of one cycle, for up to `width` right-hand sides at once.
struct CycleMemory {
  CycleMemory(const Hierarchy::Members& hierarchy, int width);

  struct Level {
    AlignedMemory x;        ///< size + 1 rows; the spare last row stays zero and is what unused corners read
    AlignedMemory b;        ///< size rows
    AlignedMemory scratch;  ///< size rows: the residual; for the last level the factor's
    AlignedMemory corner_sums;  ///< eight rows per piece of the transfer to the next level
  };
  std::vector<Level> levels;
  AlignedMemory patch_rows;  ///< two rows per node of the patches
};

/// Cycles that approximate A^-1 for kWidth right-hand sides. Every step is cut into blocks fixed by the
/// data, so the numbers do not depend on the team. Symmetric but for the patches: forward sweeps before the
/// coarse correction, backward sweeps after it; patches are solved before it alone, after it they gain nothing.
template <int kWidth>
class Cycle {
 public:
  using Float = typename Lanes<kWidth>::Float;

  Cycle(const Hierarchy::Members& hierarchy, int sweeps, ThreadTeam& team, CycleMemory& memory);

  Float* right_hand_side(int level = 0) const { return b(level); }
  Float* solution(int level = 0) const { return x(level); }

  /// solution ~ A^-1 right_hand_side, from zero.
  void v_cycle();
  /// The same from whatever is in the solution.
  void further_v_cycle();
  /// The same by full multigrid: the coarsest level first, one V-cycle on each finer one. A level
  /// that is finished_by_smoothing gets no V-cycle [Bornemann, Deuflhard 1996]: the coarse answer is already
  /// the best one of its kind, and what is left is rough.
  void full_cycle();
  /// Its two halves: everything up to the interpolated coarse answer, and what the finest level makes of it.
  void descend();
  void finish();
  /// Where the finest level is finished_by_smoothing, the same step by step: forward sweeps, and then either
  /// the backward sweeps alone or, with improve_smoothed(0), the rest of a V-cycle.
  bool finishes_by_smoothing() const { return last_level() > 0 && finished_by_smoothing(hierarchy_, 0); }
  void begin_finish();
  void finish_by_smoothing();

  /// The steps full multigrid is made of.
  void improve(int level);           ///< one V-cycle on solution(level), whatever is in it
  void improve_smoothed(int level);  ///< what of it comes behind the forward sweeps
  void solve_last_level();

 private:
  Float* x(int level) const { return memory_.levels[level].x.template as<Float>(); }
  Float* b(int level) const { return memory_.levels[level].b.template as<Float>(); }
  Float* scratch(int level) const { return memory_.levels[level].scratch.template as<Float>(); }
  Float* corner_sums(int level) const { return memory_.levels[level].corner_sums.template as<Float>(); }
  int last_level() const { return static_cast<int>(hierarchy_.matrices.size()) - 1; }

  void clear(int level);
  void solve_patches(int level);
  void smooth_forward(int level, int count);
  void smooth_backward(int level, int count);
  template <typename Sweep>
  void sweep_parity(int level, int parity, const Sweep& sweep);

  void restrict_from(int level, const Float* fine);  // b(level + 1) = P^T fine
  void restrict_residual(int level);  // b(level + 1) = P^T (b - A x)(level), and x(level + 1) = 0
  void interpolate(int level);        // x(level) = P x(level + 1)
  void correct(int level);            // x(level) += P x(level + 1)

  const Hierarchy::Members& hierarchy_;
  int sweeps_;
  ThreadTeam& team_;
  CycleMemory& memory_;
};

}  // namespace sinew
