// LinearSolver::correct(): iterative refinement by whoever knows the residual.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "allocation_counter.h"
#include "graphs.h"
#include "refusal.h"
#include "solver/cholesky.h"
#include "solver/conjugate_gradients.h"
#include "solver/multigrid.h"

namespace sinew {
namespace {

/// Leaves every correction its reach.
constexpr double kEnough = std::numeric_limits<double>::infinity();

std::vector<std::unique_ptr<LinearSolver>> all_solvers(const LinearSystem& system, ThreadTeam& team) {
  std::vector<std::unique_ptr<LinearSolver>> solvers;
  solvers.push_back(std::make_unique<MultigridSolver>(system, MultigridOptions{}, team));
  solvers.push_back(std::make_unique<CholeskySolver>(system));
  solvers.push_back(std::make_unique<ConjugateGradientSolver>(system));
  return solvers;
}

void set_residual(const Columns& rows, CorrectionWorkspace& workspace) {
  for (Eigen::Index i = 0; i < rows.rows(); ++i)
    workspace.residual[i] << rows.row(i).transpose().cast<float>(), 0.0f;
}

Columns direct_answer(const graphs::Problem& problem) {
  const CholeskySolver direct(problem.system);
  Columns answer(problem.b.rows(), 3);
  direct.solve(problem.b, answer, {}, *direct.make_workspace(3));
  return answer;
}

double largest(const Columns& rows) {
  return rows.rowwise().norm().maxCoeff();
}

// Of the correction, beside the answer to its residual.
double largest_error(const Columns& wanted, const CorrectionWorkspace& workspace) {
  Columns left = wanted;
  for (Eigen::Index i = 0; i < left.rows(); ++i)
    left.row(i) -= workspace.correction[i].head<3>().cast<double>().transpose();
  return largest(left);
}

// x <- x + correction of b - A x, `steps` times, the first one far, the others as far as `later` says.
void refine(const LinearSolver& solver, const graphs::Problem& problem, int steps, Columns& x,
            Reach later = Reach::near) {
  const auto workspace = solver.make_correction_workspace();
  Columns r;
  for (int step = 0; step < steps; ++step) {
    residual(problem.system, problem.b, x, r);
    set_residual(r, *workspace);
    EXPECT_GE(solver.correct(step == 0 ? Reach::far : later, kEnough, *workspace).cycles, 0);
    for (Eigen::Index i = 0; i < r.rows(); ++i)
      x.row(i) += workspace->correction[i].head<3>().cast<double>().transpose();
  }
}

TEST(Correction, refinement_with_any_solver_ends_at_the_direct_answer) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(5000));
  ThreadTeam team(1);
  const Columns wanted = direct_answer(problem);
  for (const auto& solver : all_solvers(problem.system, team)) {
    for (const Reach later : {Reach::near, Reach::light}) {
      Columns x = Columns::Zero(problem.b.rows(), 3);
      refine(*solver, problem, 12, x, later);
      EXPECT_LT((x - wanted).norm(), 1e-6 * wanted.norm()) << solver->name();
    }
  }
}

TEST(Correction, going_on_with_any_solver_ends_at_the_direct_answer_to_single_precision) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(5000));
  ThreadTeam team(1);
  const Columns wanted = direct_answer(problem);
#ifdef __FMA__
  constexpr double single_precision = 1e-6;
#else
  constexpr double single_precision = 2e-6;  // products are rounded before they are added
#endif
  for (const auto& solver : all_solvers(problem.system, team)) {
    const auto workspace = solver->make_correction_workspace();
    set_residual(problem.b, *workspace);
    const auto error = [&] { return largest_error(wanted, *workspace); };
    for (const auto& [reach, cycles] : {std::pair(Reach::near, 12), std::pair(Reach::light, 20)}) {
      double left = solver->correct(reach, kEnough, *workspace).error_left;
      EXPECT_LT(error(), 2 * left) << solver->name();
      for (int cycle = 0; cycle < cycles; ++cycle) {
        left = solver->correct_further(reach, *workspace).error_left;
        EXPECT_LT(error(), 2 * left) << solver->name() << ", cycle " << cycle;
      }
      EXPECT_LT(error(), single_precision * largest(wanted)) << solver->name();
      EXPECT_LT(left, 2e-6 * largest(wanted)) << solver->name();
    }
  }
}

TEST(Correction, estimates_of_v_cycles_are_within_twice_the_error) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(20000));
  ThreadTeam team(1);
  const MultigridSolver solver(problem.system, {}, team);
  const CholeskySolver direct(problem.system);
  const auto workspace = solver.make_correction_workspace();
  Columns x = Columns::Zero(problem.b.rows(), 3), r, wanted(problem.b.rows(), 3);
  refine(solver, problem, 1, x);
  for (const Reach reach : {Reach::near, Reach::light, Reach::near}) {
    residual(problem.system, problem.b, x, r);
    direct.solve(r, wanted, {}, *direct.make_workspace(3));
    set_residual(r, *workspace);
    const double left = solver.correct(reach, kEnough, *workspace).error_left;
    EXPECT_LT(largest_error(wanted, *workspace), 2 * left);
    EXPECT_GT(largest_error(wanted, *workspace), left / 2);
    for (Eigen::Index i = 0; i < r.rows(); ++i)
      x.row(i) += workspace->correction[i].head<3>().cast<double>().transpose();
  }
}

TEST(Correction, one_far_reaching_cycle_leaves_less_than_a_hundredth) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(20000));
  ThreadTeam team(1);
  const MultigridSolver solver(problem.system, {}, team);
  const Columns wanted = direct_answer(problem);
  Columns x = Columns::Zero(problem.b.rows(), 3);
  refine(solver, problem, 1, x);
  EXPECT_LT((x - wanted).cwiseAbs().maxCoeff(), 0.01 * wanted.cwiseAbs().maxCoeff());
}

TEST(Correction, full_multigrid_goes_on_to_a_v_cycle_where_smoothing_would_leave_too_much) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(20000));
  ThreadTeam team(1);
  const MultigridSolver solver(problem.system, {}, team);
  const Columns wanted = direct_answer(problem);
  const auto workspace = solver.make_correction_workspace();
  set_residual(problem.b, *workspace);
  const auto error = [&] { return largest_error(wanted, *workspace); };
  const CorrectionReport far = solver.correct(Reach::far, kEnough, *workspace);
  EXPECT_EQ(far.reach, Reach::far);
  EXPECT_EQ(far.cycles, 1);
  const double smoothed = error();
  EXPECT_LT(smoothed, 2 * far.error_left);
  EXPECT_EQ(solver.correct(Reach::far, 1.3 * far.error_left, *workspace).reach, Reach::far);
  const CorrectionReport whole = solver.correct(Reach::far, 0.5 * far.error_left, *workspace);
  EXPECT_EQ(whole.reach, Reach::whole);
  EXPECT_EQ(whole.cycles, 2);
  EXPECT_LT(whole.error_left, 0.5 * far.error_left);
  const double corrected = error();
  EXPECT_LT(corrected, 0.6 * smoothed);
  EXPECT_LT(corrected, 2 * whole.error_left);
  EXPECT_EQ(solver.correct(Reach::whole, kEnough, *workspace).error_left, whole.error_left);
  EXPECT_EQ(error(), corrected);
}

TEST(Correction, bytes_do_not_depend_on_threads_and_nothing_is_allocated) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(20000));
  std::vector<Eigen::Vector4f> answers[2];
  for (int threads : {1, 2}) {
    ThreadTeam team(threads);
    const MultigridSolver solver(problem.system, {}, team);
    const auto workspace = solver.make_correction_workspace();
    set_residual(problem.b, *workspace);
    const long before = allocation_count();
    solver.correct(Reach::far, kEnough, *workspace);
    solver.correct(Reach::near, kEnough, *workspace);
    solver.correct(Reach::whole, kEnough, *workspace);
    solver.correct_further(Reach::near, *workspace);
    EXPECT_EQ(allocation_count(), before);
    answers[threads - 1].assign(workspace->correction.begin(), workspace->correction.end());
  }
  EXPECT_EQ(std::memcmp(answers[0].data(), answers[1].data(), answers[0].size() * sizeof(Eigen::Vector4f)),
            0);
}

TEST(Correction, a_workspace_of_another_solver_is_refused) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_ball(500));
  ThreadTeam team(1);
  const auto solvers = all_solvers(problem.system, team);
  EXPECT_EQ(
      refusal([&] { solvers[0]->correct(Reach::near, kEnough, *solvers[1]->make_correction_workspace()); }),
      "MultigridSolver::correct: the workspace was made by another solver");
  EXPECT_EQ(
      refusal([&] { solvers[1]->correct(Reach::near, kEnough, *solvers[2]->make_correction_workspace()); }),
      "cholesky::correct: the workspace was made by another solver");
  EXPECT_EQ(
      refusal([&] { solvers[0]->correct_further(Reach::near, *solvers[1]->make_correction_workspace()); }),
      "MultigridSolver::correct: the workspace was made by another solver");
}

}  // namespace
}  // namespace sinew
