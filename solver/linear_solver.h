#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "solver/field.h"

namespace sinew {

/// How far to go. Missing the tolerance is an outcome (see SolveReport), not an exception.
struct SolveOptions {
  double tolerance = 1e-3;  ///< relative residual |b - A x| / |b|, worst of the columns; > 0
  int max_cycles = 60;      ///< stop here even if the tolerance is not reached
  bool from_zero = false;   ///< ignore the first guess and begin with full multigrid from zero

  /// Begin with full multigrid also from a first guess: right while what is wrong with the guess is
  /// smooth, as after a prediction in time. A plain cycle is a third cheaper and does as well where the
  /// guess is good far away and wrong nearby. Multigrid alone looks at it.
  bool full_first_cycle = true;
};

/// How a solve went.
struct SolveReport {
  int cycles = 0;          ///< multigrid cycles, or iterations of the other solvers; 0 for a direct one
  double residual = 0;     ///< |b - A x| / |b| after the last cycle, in double; the worst of the columns
  bool converged = false;  ///< residual <= SolveOptions::tolerance

  /// Multigrid alone: the largest change the last cycle made to any number of x, 0 without a cycle. The
  /// error left is mostly two to seven times what one more cycle would change.
  double largest_change = 0;
};

/// Scratch memory of one thread of solves. Made by the solver it serves.
class SolverWorkspace {
 public:
  virtual ~SolverWorkspace() = default;
};

/// How far a correction must reach.
enum class Reach {
  light,  ///< what is wrong lies near by and is small: one V-cycle with half the smoothing
  near,  ///< what is wrong lies near by: one V-cycle
  far,   ///< what is wrong is smooth over the whole body: full multigrid, the finest level smoothed alone
  whole  ///< and too large for that: full multigrid with a V-cycle on the finest level as well
};

/// What a step takes, counted rather than measured: the same on every machine and in every run.
struct CycleCost {
  std::int64_t bytes = 0;       ///< read and written when every pass finds nothing in a cache
  std::int64_t operations = 0;  ///< floating-point additions and multiplications
};

/// Memory of one thread of corrections, in rows of x, y, z and a zero. Made by the solver it serves.
class CorrectionWorkspace {
 public:
  virtual ~CorrectionWorkspace() = default;
  std::span<Eigen::Vector4f> residual;  ///< n rows of b - A x: the caller's to fill; the fourth numbers are 0
  std::span<const Eigen::Vector4f> correction;  ///< n rows to add to x: what correct() answers
};

/// What a correction was worth.
struct CorrectionReport {
  int cycles = 0;             ///< as SolveReport::cycles; Reach::whole counts as two
  Reach reach = Reach::near;  ///< of the cycle: the one asked for, but for correct() of Reach::far
  double error_left = 0;  ///< estimate: the largest error of any node left, in the unit of the correction
  /// What single precision leaves of that: only a correction of the residual at the new place takes it away.
  double rounding = 0;
};

/// The one interface all solvers stand behind: prepared once for a matrix, asked every frame.
class LinearSolver {
 public:
  virtual ~LinearSolver() = default;

  /// Memory for solves of up to `columns` right-hand sides at once. The only call that allocates.
  virtual std::unique_ptr<SolverWorkspace> make_workspace(int columns) const = 0;

  /// Solves A x = b. `b` and `x` are n x k with k <= the workspace's columns; `x` holds the first
  /// guess on entry and the answer on return. Allocates nothing. The answer does not depend on the
  /// number of threads. Throws std::invalid_argument when shapes or the workspace do not fit.
  virtual SolveReport solve(const Eigen::Ref<const Columns>& b, Eigen::Ref<Columns> x,
                            const SolveOptions& options, SolverWorkspace& workspace) const = 0;

  /// Memory for correct(). Allocates.
  virtual std::unique_ptr<CorrectionWorkspace> make_correction_workspace() const;

  /// One step of iterative refinement on three columns: correction ~ A^-1 residual, in single precision. For
  /// callers that know the residual better than `solve` can, as edge by edge differences that never form b.
  /// Multigrid runs one cycle of the wanted reach, and makes Reach::whole of Reach::far where that would leave
  /// more than `enough`, an error_left; solvers without cycles solve to 1e-6. Allocates nothing; the answer does
  /// not depend on the number of threads. Throws std::invalid_argument when the workspace was made by another
  /// solver.
  virtual CorrectionReport correct(Reach reach, double enough, CorrectionWorkspace& workspace) const;

  /// Where that left too much: the workspace's correction for the same residual once more, now from itself.
  /// Multigrid adds a V-cycle, with half the smoothing for Reach::light; solvers without cycles go on to 1e-10.
  /// Cheaper than another residual and another correct(), but CorrectionReport::rounding stays. Otherwise as
  /// correct().
  virtual CorrectionReport correct_further(Reach reach, CorrectionWorkspace& workspace) const;

  virtual std::string name() const = 0;
  virtual int size() const = 0;           ///< n
  virtual std::size_t bytes() const = 0;  ///< held by the prepared solver, workspaces not counted
};

}  // namespace sinew
