// The only file that includes cholmod.h. [Chen, Davis, Hager, Rajamanickam 2008: CHOLMOD]
#include "solver/cholesky.h"

#include <cholmod.h>

#include <algorithm>
#include <cmath>
#include <new>
#include <stdexcept>
#include <string>

#include "solver/solve_checks.h"

namespace sinew {
namespace {

// CHOLMOD keeps its settings, its status and its scratch arrays in one record, which two threads
// must not share: the solver has one for the factorisation and every workspace has its own.
class CholmodSession {
 public:
  CholmodSession() {
    cholmod_l_start(&common);
    common.print = 0;
    common.supernodal = CHOLMOD_SUPERNODAL;
  }
  ~CholmodSession() { cholmod_l_finish(&common); }
  CholmodSession(const CholmodSession&) = delete;
  CholmodSession& operator=(const CholmodSession&) = delete;
  cholmod_common common;
};

void check_memory(const cholmod_common& common) {
  if (common.status == CHOLMOD_OUT_OF_MEMORY || common.status == CHOLMOD_TOO_LARGE) throw std::bad_alloc();
}

// CHOLMOD reads the upper triangle by columns, which is the lower one by rows.
cholmod_sparse* upper_triangle(const LinearSystem& system, cholmod_common& common) {
  const Graph& graph = system.graph;
  const auto n = static_cast<std::size_t>(graph.node_count());
  const std::size_t entries = n + graph.neighbors.size() / 2;
  cholmod_sparse* A = cholmod_l_allocate_sparse(n, n, entries, /*sorted=*/1, /*packed=*/1, /*stype=*/1,
                                                CHOLMOD_REAL, &common);
  check_memory(common);
  auto* starts = static_cast<SuiteSparse_long*>(A->p);
  auto* rows = static_cast<SuiteSparse_long*>(A->i);
  auto* values = static_cast<double*>(A->x);
  SuiteSparse_long next = 0;
  for (int column = 0; column < graph.node_count(); ++column) {
    starts[column] = next;
    double diagonal = system.anchor[column];
    for (int k = graph.offsets[column]; k < graph.offsets[column + 1]; ++k) {
      diagonal += graph.weights[k];
      if (graph.neighbors[k] > column) continue;
      rows[next] = graph.neighbors[k];
      values[next++] = -graph.weights[k];
    }
    rows[next] = column;
    values[next++] = diagonal;
  }
  starts[graph.node_count()] = next;
  return A;
}

struct CholeskyWorkspace : SolverWorkspace {
  ~CholeskyWorkspace() override {
    for (cholmod_dense** dense : {&b, &x, &y, &e}) cholmod_l_free_dense(dense, &session.common);
  }
  CholmodSession session;
  cholmod_dense* b = nullptr;  // right-hand sides, column after column
  cholmod_dense* x = nullptr;  // answers, likewise
  cholmod_dense* y = nullptr;  // CHOLMOD's own scratch
  cholmod_dense* e = nullptr;
  Columns residual;
  int columns = 0;
};

}  // namespace

struct CholeskySolver::Members {
  ~Members() { cholmod_l_free_factor(&factor, &session.common); }
  CholmodSession session;
  LinearSystem system;  // for the residual; rest positions left out
  cholmod_factor* factor = nullptr;

  // Only the first `columns` columns of the workspace's arrays take part.
  void substitute(CholeskyWorkspace& workspace, int columns) const {
    workspace.b->ncol = static_cast<std::size_t>(columns);
    cholmod_l_solve2(CHOLMOD_A, factor, workspace.b, nullptr, &workspace.x, nullptr, &workspace.y,
                     &workspace.e, &workspace.session.common);
    check_memory(workspace.session.common);
  }
};

CholeskySolver::CholeskySolver(const LinearSystem& system) : members_(std::make_unique<Members>()) {
  Members& m = *members_;
  check_system("CholeskySolver", system);
  m.system.graph = system.graph;
  m.system.anchor = system.anchor;
  if (size() == 0) return;
  cholmod_common& common = m.session.common;
  cholmod_sparse* A = upper_triangle(system, common);
  m.factor = cholmod_l_analyze(A, &common);
  if (m.factor != nullptr) cholmod_l_factorize(A, m.factor, &common);
  cholmod_l_free_sparse(&A, &common);
  check_memory(common);
  if (common.status != CHOLMOD_OK || m.factor->minor < m.factor->n)
    throw std::invalid_argument("CholeskySolver: the matrix is not positive definite at row " +
                                std::to_string(m.factor != nullptr ? m.factor->minor : 0));
}

CholeskySolver::~CholeskySolver() = default;

std::unique_ptr<SolverWorkspace> CholeskySolver::make_workspace(int columns) const {
  check_workspace_columns("CholeskySolver", columns);
  auto workspace = std::make_unique<CholeskyWorkspace>();
  workspace->columns = columns;
  workspace->residual.resize(size(), columns);
  if (size() == 0) return workspace;
  workspace->b = cholmod_l_zeros(static_cast<std::size_t>(size()), static_cast<std::size_t>(columns),
                                 CHOLMOD_REAL, &workspace->session.common);
  check_memory(workspace->session.common);
  members_->substitute(*workspace, columns);  // CHOLMOD sizes its scratch arrays at the first solve
  return workspace;
}

SolveReport CholeskySolver::solve(const Eigen::Ref<const Columns>& b, Eigen::Ref<Columns> x,
                                  const SolveOptions& options, SolverWorkspace& workspace) const {
  auto& own = workspace_of<CholeskyWorkspace>("CholeskySolver", workspace);
  check_shapes("CholeskySolver", size(), own.columns, b, x);
  SolveReport report;
  if (size() == 0 || b.cols() == 0) {
    report.converged = true;
    return report;
  }
  using ByColumn = Eigen::Map<Eigen::MatrixXd>;
  ByColumn(static_cast<double*>(own.b->x), b.rows(), b.cols()) = b;
  members_->substitute(own, static_cast<int>(b.cols()));
  x = ByColumn(static_cast<double*>(own.x->x), b.rows(), b.cols());

  report.residual = relative_residual(members_->system, b, x, own.residual);
  report.converged = report.residual <= options.tolerance;
  return report;
}

std::string CholeskySolver::name() const {
  return "cholesky";
}

int CholeskySolver::size() const {
  return members_->system.graph.node_count();
}

std::size_t CholeskySolver::bytes() const {
  const Graph& graph = members_->system.graph;
  std::size_t total = graph.offsets.size() * sizeof(int) +
                      graph.neighbors.size() * (sizeof(int) + sizeof(double)) +
                      static_cast<std::size_t>(size()) * sizeof(double);
  if (const cholmod_factor* factor = members_->factor)
    total += factor->xsize * sizeof(double) +
             (factor->ssize + 3 * (factor->nsuper + 1) + 2 * factor->n) * sizeof(SuiteSparse_long);
  return total;
}

}  // namespace sinew
