// [Hestenes, Stiefel 1952]; preconditioner [Lin, Moré 1999] as Eigen has it.
#include "solver/conjugate_gradients.h"

#include <Eigen/IterativeLinearSolvers>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "solver/solve_checks.h"

namespace sinew {
namespace {

using Preconditioner = Eigen::IncompleteCholesky<double, Eigen::Lower, Eigen::AMDOrdering<int>>;

struct ConjugateGradientWorkspace : SolverWorkspace {
  Field b, x, r, z, p, Ap;  // one column
  Columns residual;
  int columns = 0;
};

}  // namespace

struct ConjugateGradientSolver::Members {
  LinearSystem system;  // for the final residual; rest positions left out
  SparseMatrix A;
  Preconditioner preconditioner;

  // Returns the iterations taken. The residual is updated, not recomputed: the report measures it.
  int solve_column(const SolveOptions& options, ConjugateGradientWorkspace& w) const {
    const double goal = options.tolerance * w.b.norm();
    w.r = w.b;
    w.r.noalias() -= A * w.x;
    double rz = 0;
    for (int iteration = 0; iteration < options.max_cycles; ++iteration) {
      if (w.r.norm() <= goal) return iteration;
      w.z = preconditioner.solve(w.r);
      const double rz_new = w.r.dot(w.z);
      if (iteration == 0)
        w.p = w.z;
      else
        w.p = w.z + (rz_new / rz) * w.p;
      rz = rz_new;
      w.Ap.noalias() = A * w.p;
      const double alpha = rz / w.p.dot(w.Ap);
      w.x += alpha * w.p;
      w.r -= alpha * w.Ap;
    }
    return options.max_cycles;
  }
};

ConjugateGradientSolver::ConjugateGradientSolver(const LinearSystem& system)
    : members_(std::make_unique<Members>()) {
  check_system("ConjugateGradientSolver", system);
  members_->system.graph = system.graph;
  members_->system.anchor = system.anchor;
  members_->A = matrix(system);
  if (size() == 0) return;
  members_->preconditioner.compute(members_->A);
  if (members_->preconditioner.info() != Eigen::Success)
    throw std::invalid_argument("ConjugateGradientSolver: incomplete Cholesky factorisation failed");
}

ConjugateGradientSolver::~ConjugateGradientSolver() = default;

std::unique_ptr<SolverWorkspace> ConjugateGradientSolver::make_workspace(int columns) const {
  check_workspace_columns("ConjugateGradientSolver", columns);
  auto workspace = std::make_unique<ConjugateGradientWorkspace>();
  workspace->columns = columns;
  workspace->residual.resize(size(), columns);
  for (Field* field :
       {&workspace->b, &workspace->x, &workspace->r, &workspace->z, &workspace->p, &workspace->Ap})
    field->resize(size());
  return workspace;
}

SolveReport ConjugateGradientSolver::solve(const Eigen::Ref<const Columns>& b, Eigen::Ref<Columns> x,
                                           const SolveOptions& options, SolverWorkspace& workspace) const {
  auto& own = workspace_of<ConjugateGradientWorkspace>("ConjugateGradientSolver", workspace);
  check_shapes("ConjugateGradientSolver", size(), own.columns, b, x);
  SolveReport report;
  report.converged = true;
  if (size() == 0 || b.cols() == 0) return report;
  if (options.from_zero) x.setZero();
  for (Eigen::Index column = 0; column < b.cols(); ++column) {
    own.b = b.col(column);
    own.x = x.col(column);
    report.cycles = std::max(report.cycles, members_->solve_column(options, own));
    x.col(column) = own.x;
  }
  report.residual = relative_residual(members_->system, b, x, own.residual);
  report.converged = report.residual <= options.tolerance;
  return report;
}

std::string ConjugateGradientSolver::name() const {
  return "pcg";
}

int ConjugateGradientSolver::size() const {
  return members_->system.graph.node_count();
}

std::size_t ConjugateGradientSolver::bytes() const {
  const auto n = static_cast<std::size_t>(size());
  const std::size_t links = members_->system.graph.neighbors.size();
  const std::size_t matrix_entries = links + n;
  const std::size_t factor_entries = links / 2 + n;
  return (links + matrix_entries + factor_entries) * (sizeof(int) + sizeof(double)) +
         n * (4 * sizeof(int) + 3 * sizeof(double));
}

}  // namespace sinew
