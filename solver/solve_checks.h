#pragma once

#include <stdexcept>
#include <string>

#include "solver/laplacian.h"
#include "solver/linear_solver.h"

/// What every solver of this folder asks of its arguments, with the same words.
namespace sinew {

/// Throws std::invalid_argument, naming `solver`, unless the parts of `system` have matching sizes
/// and every component holds an anchored node. `system.rest_positions` is not looked at.
void check_system(const char* solver, const LinearSystem& system);

/// Throws std::invalid_argument unless `columns` is at least 1.
void check_workspace_columns(const char* solver, int columns);

/// Throws std::invalid_argument unless b and x are n x k with the same k <= workspace_columns.
void check_shapes(const char* solver, int n, int workspace_columns, const Eigen::Ref<const Columns>& b,
                  const Eigen::Ref<Columns>& x);

/// `workspace` as the type `solver` made it. Throws std::invalid_argument for another solver's.
template <typename Workspace>
Workspace& workspace_of(const char* solver, SolverWorkspace& workspace) {
  if (auto* own = dynamic_cast<Workspace*>(&workspace)) return *own;
  throw std::invalid_argument(std::string(solver) +
                              "::solve: the workspace was made by another kind of solver");
}

/// Throws std::invalid_argument: correct() of the solver `name` was given another solver's workspace.
[[noreturn]] void refuse_correction_workspace(const std::string& name);

/// Largest |b - A x| / |b| of the columns; |b - A x| itself for a column of b that is zero. `scratch`
/// is at least n x k and keeps its size.
double relative_residual(const LinearSystem& system, const Eigen::Ref<const Columns>& b,
                         const Eigen::Ref<const Columns>& x, Columns& scratch);

}  // namespace sinew
