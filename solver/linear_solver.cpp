#include "solver/linear_solver.h"

#include <vector>

#include "solver/solve_checks.h"

namespace sinew {
namespace {

/// Far below what single precision keeps of a correction that is added to positions.
constexpr double kCorrectionTolerance = 1e-6;
/// Of the largest correction. Errors are up to 23 times as large, relatively, as residuals.
constexpr double kErrorLeft = 23 * kCorrectionTolerance;
constexpr int kMostCorrectionCycles = 2000;

struct SolvedCorrection : CorrectionWorkspace {
  const LinearSolver* solver = nullptr;
  std::unique_ptr<SolverWorkspace> workspace;
  Columns b, x;
  std::vector<Eigen::Vector4f> residual_rows, correction_rows;
};

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

CorrectionReport LinearSolver::correct(Reach, CorrectionWorkspace& workspace) const {
  auto* const own = dynamic_cast<SolvedCorrection*>(&workspace);
  if (own == nullptr || own->solver != this) refuse_correction_workspace(name());
  for (int i = 0; i < size(); ++i) own->b.row(i) = own->residual_rows[i].head<3>().cast<double>().transpose();
  const SolveOptions options = {
      .tolerance = kCorrectionTolerance, .max_cycles = kMostCorrectionCycles, .from_zero = true};
  const SolveReport report = solve(own->b, own->x, options, *own->workspace);
  for (int i = 0; i < size(); ++i)
    own->correction_rows[i].head<3>() = own->x.row(i).transpose().cast<float>();
  return {report.cycles, kErrorLeft * own->x.rowwise().norm().maxCoeff()};
}

}  // namespace sinew
