#include "solver/hierarchy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <sstream>

#include "graphs.h"
#include "refusal.h"
#include "solver/galerkin.h"
#include "solver/hierarchy_levels.h"
#include "solver/lattice_coarsening.h"

namespace sinew {
namespace {

Eigen::MatrixXd dense(const PieceTransfer& transfer) {
  Eigen::MatrixXd P =
      Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(transfer.nodes.size()), transfer.coarse_count);
  float weights[8];
  for (int piece = 0; piece < transfer.piece_count(); ++piece)
    for (int entry = transfer.piece_offsets[piece]; entry < transfer.piece_offsets[piece + 1]; ++entry) {
      trilinear_weights(&transfer.places[3 * static_cast<std::size_t>(entry)], weights);
      for (int k = 0; k < 8; ++k)
        if (const int corner = transfer.corners[8 * static_cast<std::size_t>(piece) + k];
            corner < transfer.coarse_count)
          P(transfer.nodes[entry], corner) += weights[k];
    }
  return P;
}

Hierarchy hierarchy_of(const graphs::Body& body, const HierarchyOptions& options) {
  ThreadTeam team(1);
  return Hierarchy(graphs::bent(body).system, options, team);
}

TEST(Hierarchy, the_first_transfer_reproduces_linear_functions) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_figure(3000));
  ThreadTeam team(1);
  const Hierarchy hierarchy(problem.system, {.max_levels = 1}, team);
  const LevelMatrix& finest = hierarchy.members().matrices.front();
  const double cell = 2.75 * mean_edge_length(finest, problem.system.rest_positions, team);
  const PieceCoarsening coarse = coarsen_by_lattice(finest, problem.system.rest_positions, cell, team);
  const Eigen::MatrixXd P = dense(coarse.transfer);
  EXPECT_LT((P.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-6);
  const Eigen::RowVector3d origin = problem.system.rest_positions.colwise().minCoeff();
  const Field3 interpolated = (P * coarse.positions * cell).rowwise() + origin;
  EXPECT_LT((interpolated - problem.system.rest_positions).cwiseAbs().maxCoeff(), 1e-5);
}

TEST(Hierarchy, every_coarse_matrix_is_the_galerkin_product) {
  for (const graphs::Body& body : {graphs::bcc_figure(2500), graphs::sheet(40, 40), graphs::star(3, 300)}) {
    const Hierarchy hierarchy = hierarchy_of(body, {.coarsest_size = 60});
    const Hierarchy::Members& members = hierarchy.members();
    ASSERT_GE(members.matrices.size(), 3u);
    const Hierarchy finest = hierarchy_of(body, {.max_levels = 1});
    for (std::size_t level = 0; level + 1 < members.matrices.size(); ++level) {
      const Eigen::MatrixXd A = to_sparse((level > 0 ? members : finest.members()).matrices[level]);
      const Eigen::MatrixXd coarse = to_sparse(members.matrices[level + 1]);
      const Eigen::MatrixXd P = dense(*members.transfers[level].pieces);
      EXPECT_LT((P.transpose() * A * P - coarse).norm(), 1e-6 * coarse.norm()) << "level " << level;
      EXPECT_EQ((coarse - coarse.transpose()).norm(), 0.0);
    }
  }
}

TEST(Hierarchy, parts_that_merely_pass_near_each_other_share_no_coarse_node) {
  graphs::Body body = graphs::beside(graphs::sheet(30, 30), graphs::sheet(30, 30));
  body.positions.bottomRows(900).col(2).array() += 0.4;  // a thin gap, well inside one cell
  const graphs::Problem problem = graphs::bent(body);
  const Components components = connected_components(problem.system.graph);
  ThreadTeam team(1);
  const Hierarchy hierarchy(problem.system, {.coarsest_size = 50}, team);
  Eigen::MatrixXd P = dense(*hierarchy.members().transfers[0].pieces);
  for (std::size_t level = 1; level < hierarchy.members().transfers.size(); ++level)
    P = P * dense(*hierarchy.members().transfers[level].pieces);
  for (Eigen::Index c = 0; c < P.cols(); ++c) {
    double weight[2] = {0, 0};
    for (Eigen::Index i = 0; i < P.rows(); ++i) weight[components.component[i]] += P(i, c);
    EXPECT_EQ(std::min(weight[0], weight[1]), 0.0) << "coarse node " << c;
  }
}

std::vector<int> neighbors_of(const LevelMatrix& matrix, int i) {
  if (matrix.short_rows.empty())
    return {matrix.neighbors.begin() + matrix.offsets[i], matrix.neighbors.begin() + matrix.offsets[i + 1]};
  const ShortRows& rows = matrix.short_rows;
  std::vector<int> result;
  ascend_parts(
      rows.runs, i, i + 1,
      [&](int, int, int before) {
        for (int k = 0; k < kShortRow; ++k)
          if (const int step =
                  rows.near.empty() ? rows.far[i - before].step(k) : rows.near[i - before].step(k);
              step != 0)
            result.push_back(i + step);
      },
      [&](const LatticeRun& run, int, int) {
        const auto neighbors = run.neighbors(i);
        result.assign(neighbors.begin(), neighbors.end());
      });
  std::sort(result.begin(), result.end());
  const int long_row = rows.first_long_from(i);
  if (long_row < static_cast<int>(rows.long_rows.size()) && rows.long_rows[long_row] == i)
    std::copy_if(rows.rest.begin() + rows.rest_offsets[long_row],
                 rows.rest.begin() + rows.rest_offsets[long_row + 1], std::back_inserter(result),
                 [i](int neighbor) { return neighbor != i; });
  return result;
}

TEST(Hierarchy, short_rows_say_what_the_graph_says) {
  for (const int nodes : {1000, 100000}) {
    const LinearSystem system = graphs::bent(graphs::bcc_figure(nodes)).system;
    ThreadTeam team(2);
    const Hierarchy hierarchy(system, {.coarsest_size = 100}, team);
    const LevelMatrix& finest = hierarchy.members().matrices.front();
    ASSERT_FALSE(finest.short_rows.empty());
    EXPECT_TRUE(finest.neighbors.empty());
    for (int i = 0; i < finest.size(); ++i) {
      const std::vector<int> neighbors = neighbors_of(finest, i);
      ASSERT_EQ(neighbors, std::vector<int>(system.graph.neighbors.begin() + system.graph.offsets[i],
                                            system.graph.neighbors.begin() + system.graph.offsets[i + 1]));
    }
  }
}

TEST(ShortRows, keep_long_rows_and_steps_that_do_not_fit) {
  // Node 0 has 20 neighbors, the last of them 40000 nodes away; all others have only node 0.
  std::vector<int> offsets = {0}, neighbors;
  for (int k = 1; k < 20; ++k) neighbors.push_back(k);
  neighbors.push_back(40000);
  offsets.push_back(20);
  for (int i = 1; i <= 40000; ++i) {
    if (i < 20 || i == 40000) neighbors.push_back(0);
    offsets.push_back(static_cast<int>(neighbors.size()));
  }
  const std::vector<float> diagonal(offsets.size() - 1, 1.0f);
  ThreadTeam team(1);
  const ShortRows rows = short_rows(offsets, neighbors, diagonal, team);
  EXPECT_TRUE(rows.far.empty());
  EXPECT_EQ(rows.near[0].step(kAfter), 1);
  EXPECT_EQ(rows.near[0].own, -2) << "two groups hold six neighbors";
  EXPECT_EQ(rows.near[19].step(kBefore), -19);
  EXPECT_EQ(rows.near[19].step(kAfter), 0);
  EXPECT_EQ(rows.near[19].own, -13);
  EXPECT_EQ(rows.near[100].own, -14);
  EXPECT_EQ(rows.near[40000].own, -14 - 3) << "its only neighbor is too far";
  EXPECT_EQ(rows.long_rows, (LargeVector<int>{0, 40000}));
  EXPECT_EQ(rows.rest_offsets, (LargeVector<int>{0, 8, 12}));
  EXPECT_EQ(rows.rest, (LargeVector<int>{15, 16, 17, 18, 19, 40000, 0, 0, 0, 40000, 40000, 40000}));
}

TEST(ShortRows, hold_steps_up_to_half_of_what_their_numbers_hold) {
  // Nodes 0 and 1 have a neighbor 16383 and 16384 places on: doubled, the second one needs more than 16 bits.
  std::vector<int> offsets = {0}, neighbors;
  for (int i = 0; i <= 16385; ++i) {
    if (i == 0) neighbors.push_back(16383);
    if (i == 1) neighbors.push_back(16385);
    if (i == 16383) neighbors.push_back(0);
    if (i == 16385) neighbors.push_back(1);
    offsets.push_back(static_cast<int>(neighbors.size()));
  }
  const std::vector<float> diagonal(offsets.size() - 1, 1.0f);
  ThreadTeam team(1);
  const ShortRows rows = short_rows(offsets, neighbors, diagonal, team);
  EXPECT_EQ(rows.near[0].step(kAfter), 16383);
  EXPECT_EQ(rows.near[16383].step(kBefore), -16383);
  EXPECT_EQ(rows.long_rows, (LargeVector<int>{1, 16385}));
  const std::vector<double> numbers(16386, 1.0);
  EXPECT_EQ(&rows.near[0].at(&numbers[0], kAfter), &numbers[16383]);
  EXPECT_EQ(&rows.near[16383].at(&numbers[16383], kBefore), &numbers[0]);
}

TEST(ShortRows, are_wide_where_many_steps_are) {
  // Every node of the first half is joined to the one 40000 places on.
  std::vector<int> offsets = {0}, neighbors;
  for (int i = 0; i < 80000; ++i) {
    neighbors.push_back(i < 40000 ? i + 40000 : i - 40000);
    offsets.push_back(i + 1);
  }
  const std::vector<float> diagonal(offsets.size() - 1, 1.0f);
  ThreadTeam team(2);
  const ShortRows rows = short_rows(offsets, neighbors, diagonal, team);
  EXPECT_TRUE(rows.near.empty());
  EXPECT_TRUE(rows.long_rows.empty());
  EXPECT_EQ(rows.far[7].step(kAfter), 40000);
  EXPECT_EQ(rows.far[79999].step(kBefore), -40000);
  EXPECT_EQ(rows.far[7].own, -13);
}

TEST(ShortRows, put_the_nearest_rows_where_sweeps_expect_them) {
  // Node 20 has neighbors on both sides; node 0 has fourteen after it, node 40 fourteen before it.
  std::vector<int> offsets = {0}, neighbors;
  for (int i = 0; i <= 40; ++i) {
    if (i == 0)
      for (int k = 1; k <= 14; ++k) neighbors.push_back(k);
    if (i == 20) neighbors.insert(neighbors.end(), {3, 17, 22, 35});
    if (i == 40)
      for (int k = 26; k < 40; ++k) neighbors.push_back(k);
    offsets.push_back(static_cast<int>(neighbors.size()));
  }
  const std::vector<float> diagonal(offsets.size() - 1, 1.0f);
  ThreadTeam team(1);
  const ShortRows rows = short_rows(offsets, neighbors, diagonal, team);
  const auto sorted = [&](int i) {
    std::vector<int> steps;
    for (int k = 0; k < kShortRow; ++k) steps.push_back(rows.near[i].step(k));
    std::sort(steps.begin(), steps.end());
    return steps;
  };
  EXPECT_EQ(rows.near[20].step(kBefore), -3);
  EXPECT_EQ(rows.near[20].step(kAfter), 2);
  EXPECT_EQ(rows.near[0].step(kAfter), 1);
  EXPECT_EQ(rows.near[40].step(kBefore), -1);
  for (int k = 0; k < kShortRow; ++k) {
    EXPECT_EQ(sorted(0)[k], k + 1);
    EXPECT_EQ(sorted(40)[k], k - kShortRow);
  }
}

TEST(Hierarchy, sweep_blocks_reach_only_their_neighbors) {
  const Hierarchy hierarchy = hierarchy_of(graphs::bcc_dumbbell(40000), {.coarsest_size = 500});
  EXPECT_GT(hierarchy.members().matrices.front().sweep_blocks.size(), 4u);
  for (const LevelMatrix& matrix : hierarchy.members().matrices) {
    std::vector<int> block_of(static_cast<std::size_t>(matrix.size()));
    ASSERT_EQ(matrix.sweep_blocks.front(), 0);
    ASSERT_EQ(matrix.sweep_blocks.back(), matrix.size());
    for (std::size_t block = 0; block + 1 < matrix.sweep_blocks.size(); ++block)
      for (int i = matrix.sweep_blocks[block]; i < matrix.sweep_blocks[block + 1]; ++i)
        block_of[i] = static_cast<int>(block);
    for (int i = 0; i < matrix.size(); ++i)
      for (int neighbor : neighbors_of(matrix, i)) ASSERT_LE(std::abs(block_of[i] - block_of[neighbor]), 1);
  }
}

TEST(Hierarchy, coarsens_by_more_than_five_and_stays_small) {
  const Hierarchy hierarchy = hierarchy_of(graphs::bcc_figure(60000), {});
  const std::vector<LevelSummary> levels = hierarchy.levels();
  ASSERT_GE(levels.size(), 2u);
  EXPECT_LT(5 * levels[1].nodes, levels[0].nodes);
  EXPECT_LE(levels.back().nodes, 2000);
  std::size_t bytes = 0;
  for (const LevelSummary& level : levels) bytes += level.bytes;
  EXPECT_EQ(bytes, hierarchy.bytes());
  EXPECT_LT(bytes, static_cast<std::size_t>(levels[0].nodes) * 250);
}

TEST(Hierarchy, shrinks_whatever_the_shape) {
  for (const auto& [name, body] : graphs::awkward_bodies()) {
    const Hierarchy hierarchy = hierarchy_of(body, {});
    const std::vector<LevelSummary> levels = hierarchy.levels();
    std::int64_t coarse_entries = 0;
    for (std::size_t level = 1; level < levels.size(); ++level) {
      coarse_entries += levels[level].nodes + levels[level].entries;
      EXPECT_LE(levels[level].nodes, 0.7 * levels[level - 1].nodes) << name << '\n' << hierarchy;
    }
    // A volume graph has 15 entries a node; all coarse levels of a chain together have somewhat more.
    EXPECT_LE(coarse_entries, 25 * static_cast<std::int64_t>(levels[0].nodes)) << name << '\n' << hierarchy;
    EXPECT_TRUE(levels.back().nodes <= 2000 || levels.back().entries == 0) << name << '\n' << hierarchy;
    EXPECT_TRUE(hierarchy.members().bottom) << name;
  }
}

TEST(Hierarchy, prints_its_levels) {
  std::ostringstream out;
  out << hierarchy_of(graphs::path(12), {});
  EXPECT_EQ(out.str(),
            "level      nodes      entries        bytes\n"
            "    0         10           18          472\n"
            "operator complexity 1, last level factored\n");
  std::ostringstream large;
  large << hierarchy_of(graphs::path(30002), {.max_levels = 1});
  EXPECT_NE(large.str().find("last level swept: too large to factor"), std::string::npos);
}

TEST(Hierarchy, the_same_for_any_team) {
  const LinearSystem system = graphs::bent(graphs::bcc_figure(150000)).system;
  ThreadTeam one(1), three(3);
  const Hierarchy first(system, {}, one), second(system, {}, three);
  ASSERT_EQ(first.members().matrices.size(), second.members().matrices.size());
  for (std::size_t level = 0; level < first.members().matrices.size(); ++level) {
    EXPECT_EQ(first.members().matrices[level].offsets, second.members().matrices[level].offsets);
    EXPECT_EQ(first.members().matrices[level].neighbors, second.members().matrices[level].neighbors);
    EXPECT_EQ(first.members().matrices[level].weights, second.members().matrices[level].weights);
    EXPECT_EQ(first.members().matrices[level].diagonal, second.members().matrices[level].diagonal);
  }
}

TEST(Hierarchy, refuses_options_and_systems_it_cannot_use) {
  ThreadTeam team(1);
  LinearSystem system = graphs::bent(graphs::path(12)).system;
  EXPECT_EQ(refusal([&] { Hierarchy(system, {.coarsest_size = 0}, team); }),
            "Hierarchy: coarsest_size is 0; expected at least 1");
  EXPECT_EQ(refusal([&] { Hierarchy(system, {.max_levels = 0}, team); }),
            "Hierarchy: max_levels is 0; expected at least 1");
  system.rest_positions.resize(4, 3);
  EXPECT_EQ(refusal([&] { Hierarchy(system, {}, team); }),
            "Hierarchy: rest_positions has 4 rows; expected 10");
}

}  // namespace
}  // namespace sinew
