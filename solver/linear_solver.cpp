#include "solver/linear_solver.h"

#include <vector>

#include "solver/solve_checks.h"

namespace sinew {
namespace {

/// Far below what single precision keeps of a correction that is added to positions.
constexpr double kCorrectionTolerance = 1e-6;
constexpr double kFurtherTolerance = 1e-10;
/// Of the largest correction: errors are up to so many times as large, relatively, as residuals.
constexpr double kErrorOfResidual = 23;
/// What the rows of the correction are rounded by, as a share of the largest.
constexpr double kRounding = 6e-8;
constexpr int kMostCorrectionCycles = 2000;

struct SolvedCorrection : CorrectionWorkspace {
  const LinearSolver* solver = nullptr;
  std::unique_ptr<SolverWorkspace> workspace;
  Columns b, x;

  CorrectionReport solve_to(const SolveOptions& options, Reach reach) {
    const SolveReport report = solver->solve(b, x, options, *workspace);
    for (int i = 0; i < solver->size(); ++i)
      correction_rows[i].head<3>() = x.row(i).transpose().cast<float>();
    const double largest = x.rowwise().norm().maxCoeff(), rounding = kRounding * largest;
    return {report.cycles, reach, kErrorOfResidual * options.tolerance * largest + rounding, rounding};
  }
  std::vector<Eigen::Vector4f> residual_rows, correction_rows;
};

SolvedCorrection& solved_correction_of(const LinearSolver& solver, CorrectionWorkspace& workspace) {
  auto* const own = dynamic_cast<SolvedCorrection*>(&workspace);
  if (own == nullptr || own->solver != &solver) refuse_correction_workspace(solver.name());
  return *own;
}

}  // namespace

std::unique_ptr<CorrectionWorkspace> LinearSolver::make_correction_workspace() const {
  auto made = std::make_unique<SolvedCorrection>();
  made->solver = this;
  made->workspace = make_workspace(3);
  made->b = made->x = Columns::Zero(size(), 3);
  made->residual_rows.assign(size(), Eigen::Vector4f::Zero());
  made->correction_rows.assign(size(), Eigen::Vector4f::Zero());
  made->residual = made->residual_rows;
  made->correction = made->correction_rows;
  return made;
}

CorrectionReport LinearSolver::correct(Reach reach, double, CorrectionWorkspace& workspace) const {
  SolvedCorrection& own = solved_correction_of(*this, workspace);
  for (int i = 0; i < size(); ++i) own.b.row(i) = own.residual_rows[i].head<3>().cast<double>().transpose();
  return own.solve_to(
      {.tolerance = kCorrectionTolerance, .max_cycles = kMostCorrectionCycles, .from_zero = true}, reach);
}

CorrectionReport LinearSolver::correct_further(Reach reach, CorrectionWorkspace& workspace) const {
  return solved_correction_of(*this, workspace)
      .solve_to({.tolerance = kFurtherTolerance, .max_cycles = kMostCorrectionCycles}, reach);
}

}  // namespace sinew
