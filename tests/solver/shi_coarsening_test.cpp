#include "solver/shi_coarsening.h"

#include <gtest/gtest.h>

#include <cstring>

#include "allocation_counter.h"
#include "graphs.h"
#include "refusal.h"
#include "solver/cholesky.h"
#include "solver/multigrid.h"

namespace sinew {
namespace {

graphs::Problem uneven_problem() {
  graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(1200));
  Graph& graph = problem.system.graph;
  problem.b = problem.beta;
  for (int i = 0; i < graph.node_count(); ++i)
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
      graph.weights[k] = 0.4 + ((i + graph.neighbors[k]) % 7) * 0.35;
      problem.b.row(i) += graph.weights[k] * problem.targets.row(k);
    }
  return problem;
}

// The pruned system, reordered: elevated nodes first. Edges between retained nodes are gone.
struct Pruned {
  Eigen::MatrixXd A;  // n x n
  Eigen::MatrixXd b;  // n x 3
  Eigen::Index elevated;
};

Pruned prune(const graphs::Problem& problem, const EdgeDescent& descent) {
  const Graph& graph = problem.system.graph;
  const int n = graph.node_count();
  std::vector<int> place(static_cast<std::size_t>(n));
  int retained = static_cast<int>(descent.fine_of_coarse.size());
  for (int i = 0; i < n; ++i)
    place[i] = descent.coarse_of_fine[i] >= 0 ? descent.coarse_of_fine[i] : retained++;
  Pruned pruned{Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, 3),
                static_cast<Eigen::Index>(descent.fine_of_coarse.size())};
  for (int i = 0; i < n; ++i) {
    pruned.A(place[i], place[i]) += problem.system.anchor[i];
    pruned.b.row(place[i]) += problem.beta.row(i);
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
      const int j = graph.neighbors[k];
      if (descent.coarse_of_fine[i] < 0 && descent.coarse_of_fine[j] < 0) continue;
      pruned.A(place[i], place[i]) += graph.weights[k];
      pruned.A(place[i], place[j]) -= graph.weights[k];
      pruned.b.row(place[i]) += graph.weights[k] * problem.targets.row(k);
    }
  }
  return pruned;
}

TEST(Shi2006, elevated_nodes_keep_their_distance_and_every_retained_node_has_one_near) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(4000));
  const Graph& graph = problem.system.graph;
  const EdgeDescent descent = coarsen_by_independent_set(problem.system).descent;
  double mean = 0;
  const auto length = [&](int i, int j) {
    return (problem.system.rest_positions.row(i) - problem.system.rest_positions.row(j)).norm();
  };
  for (int i = 0; i < graph.node_count(); ++i)
    for (int j : graph.neighbors_of(i)) mean += length(i, j) / static_cast<double>(graph.neighbors.size());
  for (int i = 0; i < graph.node_count(); ++i) {
    int near = 0;
    for (int j : graph.neighbors_of(i)) near += descent.coarse_of_fine[j] >= 0 ? 1 : 0;
    if (descent.coarse_of_fine[i] < 0) {
      EXPECT_GE(near, 1);
      continue;
    }
    for (int j : graph.neighbors_of(i)) {
      EXPECT_TRUE(descent.coarse_of_fine[j] < 0 || length(i, j) >= mean * std::cbrt(5.0));
    }
  }
}

TEST(Shi2006, the_coarse_matrix_is_the_schur_complement_of_the_pruned_system) {
  const graphs::Problem problem = uneven_problem();
  const ShiCoarsening coarsening = coarsen_by_independent_set(problem.system);
  const Pruned pruned = prune(problem, coarsening.descent);
  const Eigen::Index e = pruned.elevated, r = pruned.A.rows() - e;
  const Eigen::MatrixXd schur = pruned.A.topLeftCorner(e, e) -
                                pruned.A.topRightCorner(e, r) * pruned.A.bottomRightCorner(r, r).inverse() *
                                    pruned.A.bottomLeftCorner(r, e);
  const Eigen::MatrixXd coarse = matrix(coarsening.coarse);
  EXPECT_LT((coarse - schur).norm(), 1e-12 * schur.norm());
  EXPECT_EQ((coarse - coarse.transpose()).norm(), 0.0);
  EXPECT_GT(e, 50);
  EXPECT_LT(3 * e, r);
}

TEST(Shi2006, the_coarse_targets_are_those_of_the_pruned_system) {
  const graphs::Problem problem = uneven_problem();
  const ShiCoarsening coarsening = coarsen_by_independent_set(problem.system);
  const EdgeDescent& descent = coarsening.descent;
  const Pruned pruned = prune(problem, descent);
  const Eigen::Index e = pruned.elevated, r = pruned.A.rows() - e;
  const Eigen::MatrixXd wanted = pruned.b.topRows(e) - pruned.A.topRightCorner(e, r) *
                                                           pruned.A.bottomRightCorner(r, r).inverse() *
                                                           pruned.b.bottomRows(r);
  // (20) and (22), summed up to a right-hand side.
  const Graph& coarse = coarsening.coarse.graph;
  const Graph& fine = problem.system.graph;
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(e, 3);
  for (int c = 0; c < coarse.node_count(); ++c) {
    const int node = descent.fine_of_coarse[c];
    b.row(c) = problem.beta.row(node);
    for (int k = fine.offsets[node]; k < fine.offsets[node + 1]; ++k)
      if (const int i = fine.neighbors[k]; descent.coarse_of_fine[i] < 0)
        b.row(c) += fine.weights[k] * descent.inverse_reach[i] *
                    (problem.beta.row(i) + problem.system.anchor[i] * problem.targets.row(k));
    for (int entry = coarse.offsets[c]; entry < coarse.offsets[c + 1]; ++entry) {
      double shares = 0;
      for (int path = descent.path_offsets[entry]; path < descent.path_offsets[entry + 1]; ++path) {
        Eigen::RowVector3d along = problem.targets.row(descent.first_entries[path]);
        if (descent.second_entries[path] >= 0) along += problem.targets.row(descent.second_entries[path]);
        b.row(c) += coarse.weights[entry] * descent.shares[path] * along;
        shares += descent.shares[path];
      }
      EXPECT_NEAR(shares, 1.0, 1e-6);
    }
  }
  EXPECT_LT((b - wanted).norm(), 1e-6 * wanted.norm());
}

TEST(Shi2006, agrees_with_cholesky) {
  for (const graphs::Body& body : {graphs::bcc_figure(9000), graphs::sheet(60, 60), graphs::path(4000)}) {
    const graphs::Problem problem = graphs::bent(body);
    ThreadTeam team(2);
    const MultigridSolver solver(
        problem.system, {.hierarchy = {.coarsening = Coarsening::shi2006, .coarsest_size = 300}}, team);
    const auto workspace = solver.make_edge_workspace();
    const CholeskySolver direct(problem.system);
    Columns wanted(solver.size(), 3);
    direct.solve(problem.b, wanted, {}, *direct.make_workspace(3));
    const EdgeTargets targets{problem.targets, problem.beta};
    const SolveOptions options{.tolerance = 1e-10, .max_cycles = 200, .from_zero = true};
    Columns x = Columns::Random(solver.size(), 3);
    EXPECT_TRUE(solver.solve_edge_targets(targets, x, options, *workspace).converged);
    EXPECT_LT((x - wanted).norm(), 1e-6 * wanted.norm());
    x.setRandom();
    EXPECT_TRUE(solver.solve(problem.b, x, options, *workspace).converged);
    EXPECT_LT((x - wanted).norm(), 1e-6 * wanted.norm());
  }
}

TEST(Shi2006, carrying_the_targets_down_saves_most_of_the_cycles) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(30000));
  ThreadTeam team(1);
  const MultigridSolver solver(problem.system, {.hierarchy = {.coarsening = Coarsening::shi2006}}, team);
  const auto workspace = solver.make_edge_workspace();
  const SolveOptions options{.tolerance = 1e-3, .from_zero = true};
  Columns x(solver.size(), 3);
  const int along_edges =
      solver.solve_edge_targets({problem.targets, problem.beta}, x, options, *workspace).cycles;
  const int summed_up = solver.solve(problem.b, x, options, *workspace).cycles;
  EXPECT_LE(along_edges, 3);
  EXPECT_LT(2 * along_edges, summed_up);
}

TEST(EdgeTargets, mean_the_same_equations_to_the_default_hierarchy) {
  const graphs::Problem problem = uneven_problem();
  ThreadTeam team(1);
  const MultigridSolver solver(problem.system, {}, team);
  const auto workspace = solver.make_edge_workspace();
  const SolveOptions options{.tolerance = 1e-9, .from_zero = true};
  Columns x(solver.size(), 3), y(solver.size(), 3);
  solver.solve_edge_targets({problem.targets, problem.beta}, x, options, *workspace);
  solver.solve(problem.b, y, options, *workspace);
  EXPECT_LT((x - y).norm(), 1e-12 * y.norm());
}

TEST(EdgeTargets, same_bytes_for_any_team_and_nothing_allocated) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(20000));
  const EdgeTargets targets{problem.targets, problem.beta};
  Columns answers[2];
  for (int threads : {1, 3}) {
    ThreadTeam team(threads);
    const MultigridSolver solver(problem.system, {.hierarchy = {.coarsening = Coarsening::shi2006}}, team);
    const auto workspace = solver.make_edge_workspace();
    Columns x(solver.size(), 3);
    const long before = allocation_count();
    solver.solve_edge_targets(targets, x, {.from_zero = true}, *workspace);
    EXPECT_EQ(allocation_count(), before);
    answers[threads == 1 ? 0 : 1] = x;
  }
  EXPECT_EQ(std::memcmp(answers[0].data(), answers[1].data(),
                        sizeof(double) * static_cast<std::size_t>(answers[0].size())),
            0);
}

TEST(EdgeTargets, refuses_what_does_not_fit) {
  const graphs::Problem problem = graphs::bent(graphs::path(12));
  ThreadTeam team(1);
  const MultigridSolver solver(problem.system, {}, team);
  Columns x(10, 3);
  const auto workspace = solver.make_edge_workspace();
  EXPECT_EQ(refusal([&] {
              solver.solve_edge_targets({Field3(4, 3), problem.beta}, x, {}, *workspace);
            }),
            "MultigridSolver::solve_edge_targets: 4 edge rows and 10 beta rows; expected 18 and 10");
  EXPECT_EQ(refusal([&] {
              solver.solve_edge_targets({problem.targets, problem.beta}, x, {}, *solver.make_workspace(3));
            }),
            "MultigridSolver::solve_edge_targets: the workspace was not made by make_edge_workspace of this "
            "solver");
}

}  // namespace
}  // namespace sinew
