#pragma once

#include <memory>
#include <span>

#include "solver/edge_targets.h"
#include "solver/hierarchy.h"
#include "solver/laplacian.h"
#include "solver/linear_solver.h"
#include "solver/thread_team.h"

namespace sinew {

struct MultigridOptions {
  HierarchyOptions hierarchy = {};  ///< which coarse levels, and how small the last one is
  int smoothing_sweeps =
      2;  ///< Gauss-Seidel sweeps before and after each coarse correction; Galerkin levels take half
  bool conjugate_gradients = true;  ///< each cycle preconditions one step of flexible CG
};

/// Multigrid cycles over a Hierarchy; prepared once, used every frame.
class MultigridSolver : public LinearSolver {
 public:
  /// Throws std::invalid_argument when a component of the system holds no anchored node.
  /// `team` is borrowed and must outlive the solver.
  MultigridSolver(const LinearSystem& system, const MultigridOptions& options, ThreadTeam& team);
  ~MultigridSolver() override;

  std::unique_ptr<SolverWorkspace> make_workspace(int columns) const override;
  SolveReport solve(const Eigen::Ref<const Columns>& b, Eigen::Ref<Columns> x, const SolveOptions& options,
                    SolverWorkspace& workspace) const override;
  std::unique_ptr<CorrectionWorkspace> make_correction_workspace() const override;
  CorrectionReport correct(Reach reach, double enough, CorrectionWorkspace& workspace) const override;
  CorrectionReport correct_further(Reach reach, CorrectionWorkspace& workspace) const override;
  /// What one correct() of that reach takes.
  CycleCost correction_cost(Reach reach) const;

  /// Memory for solve_edge_targets, and for `solve` with up to three columns.
  std::unique_ptr<SolverWorkspace> make_edge_workspace() const;
  /// Solves for three columns whose right-hand side is given by what the edges want. With
  /// Coarsening::shi2006 and SolveOptions::from_zero the first cycle is the paper's full multigrid, which
  /// carries the targets to the coarse levels (14); otherwise the targets are merely summed up. Throws
  /// std::invalid_argument when the targets, x or the workspace do not fit.
  SolveReport solve_edge_targets(const EdgeTargets& targets, Eigen::Ref<Columns> x,
                                 const SolveOptions& options, SolverWorkspace& workspace) const;

  std::string name() const override;
  int size() const override;
  std::size_t bytes() const override;

  const Hierarchy& hierarchy() const;

 private:
  struct Members;
  std::unique_ptr<Members> members_;
};

}  // namespace sinew
