#pragma once

#include <memory>

#include "solver/laplacian.h"
#include "solver/linear_solver.h"

namespace sinew {

/// Conjugate gradients preconditioned by Eigen's incomplete Cholesky factorisation, one column at a
/// time. SolveReport::cycles is the largest iteration count of the columns; SolveOptions::max_cycles
/// bounds it, so allow some hundreds. `solve` itself allocates nothing; Eigen's preconditioner makes
/// a temporary or two of n numbers each time it is applied.
class ConjugateGradientSolver : public LinearSolver {
 public:
  explicit ConjugateGradientSolver(const LinearSystem& system);
  ~ConjugateGradientSolver() override;

  std::unique_ptr<SolverWorkspace> make_workspace(int columns) const override;
  SolveReport solve(const Eigen::Ref<const Columns>& b, Eigen::Ref<Columns> x, const SolveOptions& options,
                    SolverWorkspace& workspace) const override;
  std::string name() const override;
  int size() const override;
  std::size_t bytes() const override;

 private:
  struct Members;
  std::unique_ptr<Members> members_;
};

}  // namespace sinew
