#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "graphs.h"
#include "solver/hierarchy_levels.h"
#include "solver/multigrid.h"

namespace sinew {
namespace {

/// A ball of volume, and a sheet of 24 x 24 nodes crumpled so small that it lies within one cell of any
/// lattice: the coarse levels see next to nothing of it.
graphs::Body ball_and_crumpled_sheet() {
  const graphs::Body ball = graphs::bcc_ball(20000);
  graphs::Body sheet = graphs::sheet(24, 24);
  sheet.positions *= 0.01;
  sheet.positions.col(0).array() += 2.0 * ball.positions.cwiseAbs().maxCoeff();
  return graphs::beside(ball, sheet);
}

std::vector<int> patch_of_node(const Hierarchy::Members& members) {
  std::vector<int> result(static_cast<std::size_t>(members.matrices.front().size()), -1);
  for (std::size_t index = 0; index < members.patches.size(); ++index)
    for (const int node : members.patches[index].nodes) {
      EXPECT_EQ(result[node], -1) << "node " << node << " lies in two patches";
      result[node] = static_cast<int>(index);
    }
  return result;
}

TEST(Patches, no_edge_joins_two_of_them) {
  const graphs::Problem problem = graphs::bent(ball_and_crumpled_sheet());
  ThreadTeam team(1);
  const Hierarchy hierarchy(problem.system, {}, team);
  const std::vector<int> patch = patch_of_node(hierarchy.members());
  const Graph& graph = problem.system.graph;
  for (int node = 0; node < graph.node_count(); ++node)
    for (const int other : graph.neighbors_of(node))
      EXPECT_TRUE(patch[node] == patch[other] || patch[node] < 0 || patch[other] < 0)
          << node << " - " << other;
}

TEST(Patches, hold_what_the_lattice_cannot_see_and_little_else) {
  const graphs::Body body = ball_and_crumpled_sheet();
  const graphs::Problem problem = graphs::bent(body);
  ThreadTeam team(1);
  const Hierarchy hierarchy(problem.system, {}, team);
  const std::vector<int> patch = patch_of_node(hierarchy.members());
  const double edge_of_sheet = 1.5 * body.positions.cwiseAbs().maxCoeff() / 2.0;
  int in_sheet = 0, held_of_sheet = 0, held_of_ball = 0;
  for (std::size_t node = 0; node < patch.size(); ++node) {
    const bool of_sheet = problem.system.rest_positions(static_cast<Eigen::Index>(node), 0) > edge_of_sheet;
    in_sheet += of_sheet ? 1 : 0;
    if (patch[node] >= 0) ++(of_sheet ? held_of_sheet : held_of_ball);
  }
  EXPECT_GT(held_of_sheet, 0.9 * in_sheet);
  EXPECT_LT(held_of_ball, 0.1 * static_cast<double>(patch.size()));
}

TEST(Patches, come_with_what_cycles_keep_of_errors_at_every_node) {
  const graphs::Problem problem = graphs::bent(ball_and_crumpled_sheet());
  ThreadTeam team(1);
  const Hierarchy hierarchy(problem.system, {}, team);
  const LargeVector<KeptShare>& kept = hierarchy.members().kept;
  const std::vector<int> patch = patch_of_node(hierarchy.members());
  ASSERT_EQ(kept.size(), patch.size());
  std::vector<KeptShare> inside, outside;
  for (std::size_t node = 0; node < kept.size(); ++node)
    (patch[node] >= 0 ? inside : outside).push_back(kept[node]);
  const auto median = [](std::vector<KeptShare>& shares) {
    std::nth_element(shares.begin(), shares.begin() + shares.size() / 2, shares.end());
    return static_cast<float>(shares[shares.size() / 2]) / kKeptUnits;
  };
  EXPECT_NEAR(median(inside), 0.2, 0.02) << "stubborn nodes: as much as the body at large, at most";
  EXPECT_NEAR(median(outside), 0.13, 0.04);
  EXPECT_GT(*std::min_element(outside.begin(), outside.end()), 0);
}

TEST(Patches, make_a_crumpled_part_cost_no_more_cycles_than_the_body_at_large) {
  ThreadTeam team(1);
  const auto cycles_of = [&](const graphs::Body& body) {
    const graphs::Problem problem = graphs::bent(body);
    const MultigridSolver solver(problem.system, {.conjugate_gradients = false}, team);
    const auto workspace = solver.make_workspace(3);
    Columns x = Columns::Zero(solver.size(), 3);
    const SolveReport report = solver.solve(problem.b, x, {.tolerance = 1e-6, .from_zero = true}, *workspace);
    EXPECT_TRUE(report.converged);
    return report.cycles;
  };
  EXPECT_LE(cycles_of(ball_and_crumpled_sheet()), cycles_of(graphs::bcc_ball(20000)) + 1);
}

TEST(Patches, are_the_same_for_any_team) {
  const LinearSystem system = graphs::bent(ball_and_crumpled_sheet()).system;
  ThreadTeam one(1), three(3);
  const Hierarchy first(system, {}, one), second(system, {}, three);
  ASSERT_EQ(first.members().patches.size(), second.members().patches.size());
  for (std::size_t k = 0; k < first.members().patches.size(); ++k)
    EXPECT_EQ(first.members().patches[k].nodes, second.members().patches[k].nodes);
}

}  // namespace
}  // namespace sinew
