#pragma once

#include <memory>

#include "solver/laplacian.h"
#include "solver/linear_solver.h"

namespace sinew {

/// Sparse direct solver (CHOLMOD, supernodal): the truth the multigrid is tested against, and the
/// peer it is timed against. SolveReport::residual is measured, cycles is 0; the first guess is not
/// looked at. Solves with different workspaces may run at the same time.
///
/// Set-up and memory grow faster than the graph: n^2 and n^(4/3) for the inside of a body. `solve`
/// uses arrays made by make_workspace; the BLAS underneath may keep buffers of its own.
class CholeskySolver : public LinearSolver {
 public:
  /// Throws std::invalid_argument when the matrix is not positive definite, std::bad_alloc when the
  /// factor does not fit.
  explicit CholeskySolver(const LinearSystem& system);
  ~CholeskySolver() override;

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
