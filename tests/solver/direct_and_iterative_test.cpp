#include <gtest/gtest.h>

#include <limits>

#include "allocation_counter.h"
#include "graphs.h"
#include "refusal.h"
#include "solver/cholesky.h"
#include "solver/conjugate_gradients.h"

namespace sinew {
namespace {

LinearSystem uneven_system() {
  LinearSystem system = graphs::bent(graphs::bcc_dumbbell(1500)).system;
  const Graph& graph = system.graph;
  for (int i = 0; i < graph.node_count(); ++i)
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
      system.graph.weights[k] = 0.5 + ((i + graph.neighbors[k]) % 5) * 0.3;
  return system;
}

TEST(Cholesky, solves_to_rounding) {
  const LinearSystem system = uneven_system();
  const CholeskySolver solver(system);
  const auto workspace = solver.make_workspace(5);
  for (int columns : {5, 1, 3}) {
    const Columns wanted = Columns::Random(solver.size(), columns);
    const Columns b = matrix(system) * wanted;
    Columns x = Columns::Random(solver.size(), columns);
    const SolveReport report = solver.solve(b, x, {}, *workspace);
    EXPECT_LT((x - wanted).norm(), 1e-10 * wanted.norm());
    EXPECT_LT(report.residual, 1e-12);
    EXPECT_EQ(report.cycles, 0);
    EXPECT_TRUE(report.converged);
  }
  EXPECT_GT(solver.bytes(), static_cast<std::size_t>(solver.size()) * 8 * 15);
  EXPECT_EQ(solver.name(), "cholesky");
}

TEST(Cholesky, solving_allocates_nothing) {
  const LinearSystem system = uneven_system();
  const CholeskySolver solver(system);
  const auto workspace = solver.make_workspace(3);
  const Columns b = Columns::Random(solver.size(), 3);
  Columns x(solver.size(), 3);
  const long before = allocation_count();
  solver.solve(b, x, {}, *workspace);
  EXPECT_EQ(allocation_count(), before);
}

TEST(Cholesky, a_system_without_nodes_is_solved) {
  LinearSystem system;
  const CholeskySolver solver(system);
  const auto workspace = solver.make_workspace(3);
  Columns x(0, 3);
  EXPECT_TRUE(solver.solve(Columns(0, 3), x, {}, *workspace).converged);
}

TEST(ConjugateGradients, reaches_the_tolerance_and_agrees_with_cholesky) {
  const LinearSystem system = uneven_system();
  const CholeskySolver direct(system);
  const ConjugateGradientSolver iterative(system);
  const Columns b = Columns::Random(direct.size(), 3);
  Columns wanted(direct.size(), 3), x = Columns::Random(direct.size(), 3);
  direct.solve(b, wanted, {}, *direct.make_workspace(3));
  const auto workspace = iterative.make_workspace(3);
  const SolveReport report = iterative.solve(b, x, {.tolerance = 1e-10, .max_cycles = 500}, *workspace);
  EXPECT_TRUE(report.converged);
  EXPECT_LE(report.residual, 1e-10);
  EXPECT_GT(report.cycles, 1);
  EXPECT_LT((x - wanted).norm(), 1e-7 * wanted.norm());
  EXPECT_EQ(iterative.name(), "pcg");
}

TEST(ConjugateGradients, says_when_it_ran_out_of_iterations) {
  const LinearSystem system = uneven_system();
  const ConjugateGradientSolver solver(system);
  const auto workspace = solver.make_workspace(1);
  Columns x = Columns::Zero(solver.size(), 1);
  const SolveReport report =
      solver.solve(Columns::Random(solver.size(), 1), x, {.tolerance = 1e-12, .max_cycles = 3}, *workspace);
  EXPECT_EQ(report.cycles, 3);
  EXPECT_FALSE(report.converged);
}

TEST(Solvers, refuse_what_they_cannot_solve) {
  LinearSystem system = graphs::bent(graphs::beside(graphs::path(12), graphs::path(9))).system;
  for (int i = 10; i < system.graph.node_count(); ++i) system.anchor[i] = 0;
  EXPECT_EQ(refusal([&] { CholeskySolver solver(system); }),
            "CholeskySolver: 1 of 2 components hold no anchored node; the first is the one of node 10");
  EXPECT_EQ(
      refusal([&] { ConjugateGradientSolver solver(system); }),
      "ConjugateGradientSolver: 1 of 2 components hold no anchored node; the first is the one of node 10");
  system.anchor[12] = -1;
  EXPECT_EQ(refusal([&] { CholeskySolver solver(system); }),
            "CholeskySolver: anchor of node 12 is -1.000000; expected finite and not negative");
  system.anchor.resize(3);
  EXPECT_EQ(refusal([&] { CholeskySolver solver(system); }),
            "CholeskySolver: anchor has 3 entries; expected 17");
}

TEST(Solvers, refuse_arguments_that_do_not_fit) {
  const LinearSystem system = graphs::bent(graphs::path(12)).system;
  const CholeskySolver direct(system);
  const ConjugateGradientSolver iterative(system);
  const auto workspace = direct.make_workspace(2);
  Columns x(10, 3);
  EXPECT_EQ(refusal([&] { direct.make_workspace(0); }),
            "CholeskySolver::make_workspace: columns is 0; expected at least 1");
  EXPECT_EQ(refusal([&] { direct.solve(Columns(10, 3), x, {}, *workspace); }),
            "CholeskySolver::solve: 3 columns; the workspace was made for 2");
  EXPECT_EQ(refusal([&] { direct.solve(Columns(9, 3), x, {}, *workspace); }),
            "CholeskySolver::solve: b is 9 x 3 and x 10 x 3; expected 10 rows and as many columns in both");
  EXPECT_EQ(refusal([&] { iterative.solve(Columns(10, 3), x, {}, *workspace); }),
            "ConjugateGradientSolver::solve: the workspace was made by another kind of solver");
}

}  // namespace
}  // namespace sinew
