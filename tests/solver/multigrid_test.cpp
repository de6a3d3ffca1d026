#include "solver/multigrid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "allocation_counter.h"
#include "graphs.h"
#include "refusal.h"
#include "solver/cholesky.h"
#include "solver/hierarchy_levels.h"

namespace sinew {
namespace {

SolveReport solve(const graphs::Problem& problem, const MultigridOptions& options,
                  const SolveOptions& solve_options, Columns& x, int threads = 1) {
  ThreadTeam team(threads);
  const MultigridSolver solver(problem.system, options, team);
  const auto workspace = solver.make_workspace(static_cast<int>(problem.b.cols()));
  return solver.solve(problem.b, x, solve_options, *workspace);
}

// Cycles from nothing to `tolerance`.
int cycles_to(double tolerance, const graphs::Problem& problem, const MultigridOptions& options = {}) {
  Columns x = Columns::Zero(problem.b.rows(), 3);
  const SolveReport report = solve(problem, options, {.tolerance = tolerance, .from_zero = true}, x);
  EXPECT_TRUE(report.converged);
  Columns r;
  residual(problem.system, problem.b, x, r);
  double worst = 0;
  for (int c = 0; c < 3; ++c) worst = std::max(worst, r.col(c).norm() / problem.b.col(c).norm());
  EXPECT_NEAR(report.residual, worst, 1e-3 * worst + 1e-12) << "the report must be the true residual";
  return report.cycles;
}

Columns direct_answer(const graphs::Problem& problem) {
  const CholeskySolver solver(problem.system);
  Columns x(problem.b.rows(), problem.b.cols());
  solver.solve(problem.b, x, {}, *solver.make_workspace(static_cast<int>(problem.b.cols())));
  return x;
}

void expect_agreement(const graphs::Problem& problem, const MultigridOptions& options,
                      const std::string& what) {
  const Columns wanted = direct_answer(problem);
  for (bool from_zero : {true, false}) {
    Columns x = Columns::Random(wanted.rows(), wanted.cols());
    const SolveReport report =
        solve(problem, options, {.tolerance = 1e-11, .max_cycles = 100, .from_zero = from_zero}, x);
    EXPECT_TRUE(report.converged) << what << ": " << report.residual;
    EXPECT_LT((x - wanted).norm(), 1e-6 * wanted.norm()) << what;
  }
}

std::vector<std::pair<std::string, graphs::Body>> many_bodies() {
  return {{"single node", graphs::path(2)},
          {"path of three", graphs::path(3)},
          {"path", graphs::path(3000)},
          {"star", graphs::star(7, 300)},
          {"sheet", graphs::sheet(70, 50)},
          {"ribbon", graphs::sheet(900, 3)},
          {"ball", graphs::bcc_ball(4000)},
          {"dumbbell", graphs::bcc_dumbbell(5000)},
          {"figure", graphs::bcc_figure(6000)},
          {"two bodies", graphs::beside(graphs::bcc_ball(3000), graphs::sheet(30, 40))},
          {"ball and crumbs",
           graphs::beside(graphs::bcc_ball(2500), graphs::beside(graphs::path(2), graphs::path(5)))}};
}

TEST(Multigrid, agrees_with_cholesky_on_many_graphs) {
  for (const auto& [name, body] : many_bodies())
    expect_agreement(graphs::bent(body), {.hierarchy = {.coarsest_size = 200}}, name);
}

TEST(Multigrid, bodies_and_sheets_need_no_conjugate_gradients) {
  for (const auto& body : {graphs::sheet(70, 50), graphs::bcc_dumbbell(5000), graphs::bcc_figure(6000)})
    expect_agreement(graphs::bent(body), {.hierarchy = {.coarsest_size = 200}, .conjugate_gradients = false},
                     "without conjugate gradients");
}

TEST(Multigrid, agrees_with_cholesky_for_uneven_weights) {
  graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(5000));
  Graph& graph = problem.system.graph;
  for (int i = 0; i < graph.node_count(); ++i)
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
      graph.weights[k] = 0.1 + ((i + graph.neighbors[k]) % 13) * 0.2;
  expect_agreement(problem, {.hierarchy = {.coarsest_size = 200}}, "uneven weights");
}

TEST(Multigrid, agrees_with_cholesky_for_weights_that_differ_in_double_alone) {
  graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(5000));
  Graph& graph = problem.system.graph;
  for (int i = 0; i < graph.node_count(); ++i)
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
      graph.weights[k] = 1 + ((i + graph.neighbors[k]) % 13) * 1e-12;
  expect_agreement(problem, {.hierarchy = {.coarsest_size = 200}}, "nearly even weights");
}

TEST(Multigrid, needs_no_usable_positions) {
  graphs::Problem problem = graphs::bent(graphs::bcc_dumbbell(5000));
  problem.system.rest_positions.setZero();
  expect_agreement(problem, {.hierarchy = {.coarsest_size = 200}}, "all nodes in one place");
  problem.system.rest_positions.setConstant(std::numeric_limits<double>::quiet_NaN());
  expect_agreement(problem, {.hierarchy = {.coarsest_size = 200}}, "nodes nowhere");
}

TEST(Multigrid, does_not_need_the_breadth_first_order) {
  const graphs::Problem ordered = graphs::bent(graphs::bcc_ball(4000));
  const int n = ordered.system.graph.node_count();
  std::vector<int> scattered(static_cast<std::size_t>(n));
  for (int i = 0; i < n; ++i) scattered[i] = static_cast<int>((static_cast<long long>(i) * 1009) % n);
  graphs::Problem problem;
  problem.system.graph = induced_subgraph(ordered.system.graph, scattered);
  problem.system.anchor = ordered.system.anchor(scattered);
  problem.system.rest_positions = ordered.system.rest_positions(scattered, Eigen::all);
  problem.b = ordered.b(scattered, Eigen::all);
  expect_agreement(problem, {.hierarchy = {.coarsest_size = 200}}, "scattered order");
}

TEST(Multigrid, a_rest_pose_stays_where_it_is) {
  graphs::Problem problem = graphs::bent(graphs::bcc_figure(9000));
  const Columns rest = problem.system.rest_positions;
  problem.b = matrix(problem.system) * rest;
  Columns x = rest;
  const SolveReport report = solve(problem, {}, {.tolerance = 1e-9}, x);
  EXPECT_EQ(report.cycles, 0);
  EXPECT_EQ(x, rest);
}

TEST(Multigrid, any_number_of_columns_gives_the_answers_of_one) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_ball(6000));
  ThreadTeam team(1);
  const MultigridSolver solver(problem.system, {.hierarchy = {.coarsest_size = 300}}, team);
  const CholeskySolver direct(problem.system);
  const auto workspace = solver.make_workspace(37);
  const auto direct_workspace = direct.make_workspace(37);
  for (int columns : {1, 2, 3, 4, 5, 8, 9, 16, 20, 37}) {
    const Columns b = Columns::Random(solver.size(), columns);
    Columns x = Columns::Random(solver.size(), columns), wanted = x;
    const SolveReport report = solver.solve(b, x, {.tolerance = 1e-10}, *workspace);
    direct.solve(b, wanted, {}, *direct_workspace);
    EXPECT_TRUE(report.converged);
    EXPECT_LT((x - wanted).norm(), 1e-8 * wanted.norm()) << columns << " columns";
  }
}

TEST(Multigrid, a_column_of_zeros_has_the_answer_zero) {
  graphs::Problem problem = graphs::bent(graphs::bcc_ball(4000));
  problem.b.col(1).setZero();
  Columns x = Columns::Random(problem.b.rows(), 3);
  const SolveReport report = solve(problem, {}, {.tolerance = 1e-8}, x);
  EXPECT_TRUE(report.converged);
  EXPECT_EQ(x.col(1).norm(), 0.0);
  EXPECT_GT(x.col(0).norm(), 0.0);
}

TEST(Multigrid, leaves_the_memory_around_its_columns_alone) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_ball(3000));
  Columns wide = Columns::Constant(problem.b.rows(), 6, 7.0);
  ThreadTeam team(1);
  const MultigridSolver solver(problem.system, {}, team);
  const auto workspace = solver.make_workspace(3);
  solver.solve(problem.b, wide.middleCols(1, 3), {.tolerance = 1e-8, .from_zero = true}, *workspace);
  EXPECT_EQ(wide.col(0), Columns::Constant(problem.b.rows(), 1, 7.0));
  EXPECT_EQ(wide.rightCols(2), Columns::Constant(problem.b.rows(), 2, 7.0));
  EXPECT_LT((wide.middleCols(1, 3) - direct_answer(problem)).norm(), 1e-5 * wide.norm());
}

TEST(Multigrid, one_full_cycle_reaches_a_thousandth_and_few_more_a_hundred_thousandth) {
  for (const graphs::Body& body :
       {graphs::bcc_figure(10000), graphs::bcc_dumbbell(10000), graphs::bcc_ball(10000),
        graphs::bcc_figure(100000), graphs::sheet(150, 150)}) {
    const graphs::Problem problem = graphs::bent(body);
    EXPECT_LE(cycles_to(1e-3, problem), 2);
    EXPECT_LE(cycles_to(1e-5, problem), 5);
    EXPECT_LE(cycles_to(1e-5, problem, {.conjugate_gradients = false}), 7);
  }
}

TEST(Multigrid, takes_few_cycles_whatever_the_shape) {
  for (const auto& [name, body] : graphs::awkward_bodies()) {
    // Linear interpolation has little to offer where nearly every node is a tip or a fork.
    const bool branching = name == "tree" || name == "comb";
    SCOPED_TRACE(name);
    EXPECT_LE(cycles_to(1e-5, graphs::bent(body)), branching ? 30 : 15);
  }
  for (int n = 2; n <= 50; ++n) {
    EXPECT_LE(cycles_to(1e-5, graphs::bent(graphs::path(n))), 15) << "path of " << n;
    EXPECT_LE(cycles_to(1e-5, graphs::bent(graphs::hub(n))), 15) << "hub of " << n;
  }
}

TEST(MultigridLarge, half_a_million_nodes_take_as_few_cycles) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(534000));
  EXPECT_LE(cycles_to(1e-5, problem), 5);
}

TEST(Multigrid, the_cost_of_a_cycle_grows_with_the_graph_and_with_the_sweeps) {
  ThreadTeam team(1);
  const graphs::Problem small = graphs::bent(graphs::bcc_figure(20000));
  const graphs::Problem large = graphs::bent(graphs::bcc_figure(80000));
  const MultigridSolver four(large.system, {.smoothing_sweeps = 4}, team), two(large.system, {}, team);
  const MultigridSolver less(small.system, {}, team);
  const LevelMatrix& finest = two.hierarchy().members().matrices.front();
  const std::size_t once = finest.short_rows.bytes() + 52 * static_cast<std::size_t>(finest.size());
  for (Reach reach : {Reach::near, Reach::far}) {
    const CycleCost cost = two.correction_cost(reach);
    EXPECT_GT(cost.bytes, static_cast<std::int64_t>(4 * once)) << "four passes over the finest level";
    EXPECT_LT(cost.bytes, static_cast<std::int64_t>(10 * once));
    EXPECT_GT(cost.operations, 4 * 4 * static_cast<std::int64_t>(finest.entries()));
    const auto nodes = static_cast<double>(two.size()) / less.size();
    EXPECT_NEAR(static_cast<double>(cost.bytes) / static_cast<double>(less.correction_cost(reach).bytes),
                nodes, 0.2 * nodes);
  }
  EXPECT_EQ(four.correction_cost(Reach::light).bytes, two.correction_cost(Reach::near).bytes);
  EXPECT_LT(two.correction_cost(Reach::light).bytes, two.correction_cost(Reach::near).bytes);
  EXPECT_GT(two.correction_cost(Reach::whole).bytes, two.correction_cost(Reach::near).bytes);
  EXPECT_LT(two.correction_cost(Reach::whole).bytes,
            two.correction_cost(Reach::far).bytes + two.correction_cost(Reach::light).bytes);
  EXPECT_EQ(four.correction_cost(Reach::near).bytes - two.correction_cost(Reach::near).bytes -
                static_cast<std::int64_t>(4 * once),
            [&] {  // one sweep more on either side of every level that has a coarser one
              std::int64_t sum = 0;
              const auto& matrices = two.hierarchy().members().matrices;
              for (std::size_t level = 1; level + 1 < matrices.size(); ++level)
                sum += 2 * (8 * static_cast<std::int64_t>(matrices[level].neighbors.size()) +
                            56 * static_cast<std::int64_t>(matrices[level].size()));
              return sum;
            }());
}

TEST(Multigrid, stops_at_the_last_cycle_and_says_so) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(10000));
  Columns x = Columns::Zero(problem.b.rows(), 3);
  const SolveReport report = solve(problem, {}, {.tolerance = 1e-12, .max_cycles = 2}, x);
  EXPECT_EQ(report.cycles, 2);
  EXPECT_FALSE(report.converged);
  EXPECT_GT(report.residual, 1e-12);
}

TEST(Multigrid, tells_the_largest_change_of_the_last_cycle) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(10000));
  ThreadTeam team(1);
  for (bool conjugate_gradients : {true, false}) {
    const MultigridSolver solver(problem.system, {.conjugate_gradients = conjugate_gradients}, team);
    const auto workspace = solver.make_workspace(3);
    Columns two = Columns::Zero(problem.b.rows(), 3), three = two;
    solver.solve(problem.b, two, {.tolerance = 1e-14, .max_cycles = 2, .from_zero = true}, *workspace);
    const SolveReport report =
        solver.solve(problem.b, three, {.tolerance = 1e-14, .max_cycles = 3, .from_zero = true}, *workspace);
    const double change = (three - two).cwiseAbs().maxCoeff();
    EXPECT_NEAR(report.largest_change, change, 1e-5 * change);
    EXPECT_EQ(solver.solve(problem.b, three, {.tolerance = 1.0}, *workspace).largest_change, 0.0);
  }
}

TEST(Multigrid, a_good_guess_may_do_without_the_full_cycle) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(10000));
  Columns x = direct_answer(problem);
  x += 1e-3 * Columns::Random(x.rows(), 3);  // wrong nearby: no coarse level can help
  const SolveReport report = solve(problem, {}, {.tolerance = 1e-4, .full_first_cycle = false}, x);
  EXPECT_TRUE(report.converged);
  EXPECT_LE(report.cycles, 3);
}

TEST(Multigrid, a_right_hand_side_that_is_no_number_does_not_pass_for_solved) {
  graphs::Problem problem = graphs::bent(graphs::bcc_ball(3000));
  const graphs::Problem sound = problem;
  problem.b(17, 1) = std::numeric_limits<double>::quiet_NaN();
  ThreadTeam team(1);
  const MultigridSolver solver(problem.system, {.hierarchy = {.coarsest_size = 300}}, team);
  const auto workspace = solver.make_workspace(3);
  Columns x = Columns::Zero(problem.b.rows(), 3);
  EXPECT_FALSE(solver.solve(problem.b, x, {}, *workspace).converged);
  // and leaves nothing behind in the workspace
  EXPECT_TRUE(solver.solve(sound.b, x, {.from_zero = true}, *workspace).converged);
}

TEST(Multigrid, same_bytes_for_any_team) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(60000));
  const auto answer = [&](int threads, bool conjugate_gradients) {
    Columns x = Columns::Zero(problem.b.rows(), 3);
    solve(problem, {.conjugate_gradients = conjugate_gradients}, {.tolerance = 1e-6}, x, threads);
    return x;
  };
  for (bool conjugate_gradients : {true, false}) {
    const Columns one = answer(1, conjugate_gradients);
    for (int threads : {2, 3}) {
      const Columns more = answer(threads, conjugate_gradients);
      EXPECT_EQ(std::memcmp(one.data(), more.data(), sizeof(double) * static_cast<std::size_t>(one.size())),
                0)
          << threads << " threads";
    }
  }
}

TEST(Multigrid, solving_allocates_nothing) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(20000));
  ThreadTeam team(2);
  for (bool conjugate_gradients : {true, false}) {
    const MultigridSolver solver(problem.system, {.conjugate_gradients = conjugate_gradients}, team);
    const auto workspace = solver.make_workspace(12);
    const Columns b = Columns::Random(solver.size(), 12);
    Columns x = Columns::Zero(solver.size(), 12), x3 = Columns::Zero(solver.size(), 3);
    const long before = allocation_count();
    solver.solve(b, x, {.tolerance = 1e-6}, *workspace);
    solver.solve(problem.b, x3, {.tolerance = 1e-6, .from_zero = true}, *workspace);
    EXPECT_EQ(allocation_count(), before);
  }
}

TEST(Multigrid, refuses_what_it_cannot_solve) {
  ThreadTeam team(1);
  LinearSystem system = graphs::bent(graphs::beside(graphs::bcc_ball(500), graphs::path(9))).system;
  const int ball_nodes = system.graph.node_count() - 7;
  system.anchor.tail(7).setZero();
  EXPECT_EQ(refusal([&] { MultigridSolver(system, {}, team); }),
            "MultigridSolver: 1 of 2 components hold no anchored node; the first is the one of node " +
                std::to_string(ball_nodes));
  system.anchor.tail(7).setOnes();
  EXPECT_EQ(refusal([&] { MultigridSolver(system, {.smoothing_sweeps = 0}, team); }),
            "MultigridSolver: smoothing_sweeps is 0; expected at least 1");
  const MultigridSolver solver(system, {}, team), other(system, {}, team);
  const auto workspace = solver.make_workspace(2);
  Columns x(solver.size(), 3);
  EXPECT_EQ(refusal([&] { solver.solve(Columns(solver.size(), 3), x, {}, *workspace); }),
            "MultigridSolver::solve: 3 columns; the workspace was made for 2");
  EXPECT_EQ(refusal([&] { other.solve(Columns(solver.size(), 3), x, {}, *workspace); }),
            "MultigridSolver::solve: the workspace was made by another solver");
  EXPECT_EQ(refusal([&] { solver.make_workspace(0); }),
            "MultigridSolver::make_workspace: columns is 0; expected at least 1");
}

TEST(Multigrid, a_system_without_nodes_is_solved) {
  ThreadTeam team(1);
  LinearSystem system;
  system.rest_positions.resize(0, 3);
  const MultigridSolver solver(system, {}, team);
  Columns x(0, 3);
  EXPECT_TRUE(solver.solve(Columns(0, 3), x, {}, *solver.make_workspace(3)).converged);
}

}  // namespace
}  // namespace sinew
