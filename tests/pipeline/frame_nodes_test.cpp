// The passes over the edges, inside a lattice and outside, against sums edge by edge.
#include "pipeline/frame_nodes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <string>

namespace sinew {
namespace {

constexpr double kSpacing = 0.04;

/// A block of a body-centred lattice whose nodes follow each other along axis `along`, then `between`, then
/// the third; the first nodes of each line are held.
Rig lattice_block(int along, int between) {
  const std::array<int, 3> axes = {along, between, 3 - along - between}, cubes = {13, 5, 4};
  std::map<std::array<int, 3>, int> node_at;  // by half spacings across, between and along: in that order
  for (int c = 0; c <= 2 * cubes[2]; ++c)
    for (int b = 0; b <= 2 * cubes[1]; ++b)
      for (int a = 0; a <= 2 * cubes[0]; ++a)
        if (a % 2 == b % 2 && b % 2 == c % 2) node_at[{c, b, a}] = 0;
  int count = 0;
  for (auto& [place, node] : node_at) node = count++;
  Rig rig;
  rig.volume.interior = Interior::lattice;
  rig.volume.spacing = kSpacing;
  rig.volume.rest_positions.resize(count, 3);
  rig.free_of_node.assign(count, -1);
  std::vector<Edge> edges;
  for (const auto& [place, node] : node_at) {
    for (int k = 0; k < 3; ++k)
      rig.volume.rest_positions(node, axes[k]) = 0.3 + kSpacing / 2.0 * place[2 - k];
    const auto join = [&, from = node](std::array<int, 3> to) {
      if (const auto other = node_at.find(to); other != node_at.end())
        edges.push_back({from, other->second, 1.0});
    };
    const auto [c, b, a] = place;
    for (const int s : {-1, 1})
      for (const int t : {-1, 1}) join({c + 1, b + s, a + t});
    join({c + 2, b, a});
    join({c, b + 2, a});
    join({c, b, a + 2});
    if (a < 2) continue;
    rig.free_of_node[node] = static_cast<int>(rig.node_of_free.size());
    rig.node_of_free.push_back(node);
  }
  rig.volume.graph = make_graph(count, edges);
  return rig;
}

struct BlockKind {
  int along, between;
  bool weighted = false;  ///< every edge by its own weight, which leaves no runs
};

/// Any weights between 1/2 and 3/2 that both ends agree on.
void weigh(Graph& graph) {
  for (int node = 0; node + 1 < static_cast<int>(graph.offsets.size()); ++node)
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
      const int low = std::min(node, graph.neighbors[k]), high = std::max(node, graph.neighbors[k]);
      graph.weights[k] = 0.5 + (low * 31 + high * 17) % 64 / 64.0;
    }
}

Rig block_of_kind(const BlockKind& kind) {
  Rig rig = lattice_block(kind.along, kind.between);
  if (kind.weighted) weigh(rig.volume.graph);
  return rig;
}

class LatticeBlocks : public testing::TestWithParam<BlockKind> {
 protected:
  LatticeBlocks() : rig(block_of_kind(GetParam())), nodes(rig) {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> number(-1.0f, 1.0f);
    const auto three = [&] { return Eigen::Vector4f(number(random), number(random), number(random), 0.0f); };
    for (int slot = 0; slot < nodes.slot_count; ++slot) {
      for (Eigen::Vector4f& column : nodes.records[slot].column) column = three();
      const Eigen::Vector4f now = nodes.places[slot].rest + 0.1f * three();
      nodes.places[slot].now = now;
      nodes.set_position(slot, now);
    }
  }

  Eigen::Matrix3d turn(int slot) const {
    Eigen::Matrix3d columns;
    for (int k = 0; k < 3; ++k) columns.col(k) = nodes.records[slot].column[k].head<3>().cast<double>();
    return columns;
  }
  Eigen::Vector3d rest_edge(int slot, int neighbor) const {
    const auto place = [&](int s) -> Eigen::Vector3d {
      return rig.volume.rest_positions.row(nodes.node_of_slot[s]).transpose() / nodes.diagonal;
    };
    return place(slot) - place(neighbor);
  }
  Eigen::Vector3d edge_now(int slot, int neighbor) const {
    return (nodes.places[slot].now - nodes.places[neighbor].now).head<3>().cast<double>();
  }
  /// By the volume's graph.
  template <typename Body>
  void for_each_neighbor(int slot, const Body& body) const {
    const Graph& graph = rig.volume.graph;
    const int node = nodes.node_of_slot[slot];
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k)
      body(nodes.slot_of_node[graph.neighbors[k]], graph.weights[k]);
  }
  Eigen::Vector3d wanted(int slot) const {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    for_each_neighbor(slot, [&](int other, double weight) {
      sum += 0.5 * weight * (turn(slot) + turn(other)) * rest_edge(slot, other);
    });
    return sum;
  }
  Eigen::Vector3d residual(int slot) const {
    Eigen::Vector3d sum = wanted(slot);
    for_each_neighbor(slot, [&](int other, double weight) { sum -= weight * edge_now(slot, other); });
    return sum;
  }

  Rig rig;
  FrameNodes nodes;
};

TEST_P(LatticeBlocks, are_found_to_have_runs_along_their_axes) {
  if (GetParam().weighted) {
    EXPECT_TRUE(nodes.runs.empty());
    return;
  }
  EXPECT_EQ(nodes.axes.along, GetParam().along);
  EXPECT_EQ(nodes.axes.between, GetParam().between);
  EXPECT_NEAR(nodes.axes.half_spacing, kSpacing / 2.0 / nodes.diagonal, 1e-9);
  int inside = 0;
  for (int slot = 0; slot < nodes.free_count; ++slot) {
    int count = 0;
    bool held = false;
    for_each_neighbor(slot, [&](int other, double) {
      ++count;
      held |= other >= nodes.free_count;
    });
    inside += count == 14 && !held ? 1 : 0;
  }
  EXPECT_GT(row_count(nodes.runs), 3 * inside / 4);
  EXPECT_LT(row_count(nodes.runs), 3 * nodes.free_count / 4) << "the others are tested as well";
}

TEST_P(LatticeBlocks, know_all_neighbors) {
  for (int slot = 0; slot < nodes.free_count; ++slot) {
    std::vector<std::pair<int, float>> wanted, found;
    for_each_neighbor(
        slot, [&](int other, double weight) { wanted.emplace_back(other, static_cast<float>(weight)); });
    nodes.for_each_neighbor(slot, [&](int other, float weight) { found.emplace_back(other, weight); });
    std::sort(wanted.begin(), wanted.end());
    ASSERT_EQ(found, wanted) << "slot " << slot;
  }
}

TEST_P(LatticeBlocks, residuals_are_those_of_all_edges) {
  const int first = 33, end = nodes.free_count - 41;
  const Eigen::Vector4f untouched = Eigen::Vector4f::Constant(7.0f);
  LargeVector<Eigen::Vector4f> rows(nodes.free_count, untouched);
  residual_rows(nodes, first, end, rows.data());
  for (int slot = 0; slot < nodes.free_count; ++slot) {
    if (slot < first || slot >= end) {
      ASSERT_EQ(rows[slot], untouched);
      continue;
    }
    ASSERT_LT((rows[slot].head<3>().cast<double>() - residual(slot)).norm(), 3e-6) << "slot " << slot;
    ASSERT_EQ(rows[slot][3], 0.0f);
  }
}

TEST_P(LatticeBlocks, measure_what_the_residual_and_the_right_hand_side_are) {
  SystemSize wanted_size;
  for (int slot = 0; slot < nodes.free_count; ++slot) {
    Eigen::Vector3d b = wanted(slot);
    for_each_neighbor(slot, [&](int other, double weight) {
      if (other >= nodes.free_count) b += weight * nodes.places[other].now.head<3>().cast<double>();
    });
    wanted_size.residual += residual(slot).squaredNorm();
    wanted_size.right_hand_side += b.squaredNorm();
  }
  const SystemSize size = measure_rows(nodes, 0, nodes.free_count);
  EXPECT_NEAR(size.residual, wanted_size.residual, 1e-5 * wanted_size.residual);
  EXPECT_NEAR(size.right_hand_side, wanted_size.right_hand_side, 1e-5 * wanted_size.right_hand_side);
}

TEST_P(LatticeBlocks, local_steps_see_all_edges) {
  for (const int start : {0, 3}) {
    int next = first_run_behind(nodes.runs, start);
    for (int first = start; first < nodes.free_count; first += kFitLanes) {
      const int count = std::min(kFitLanes, nodes.free_count - first);
      FitBatch batch;
      sum_edges(nodes, first, count, next, batch);
      for (int lane = 0; lane < count; ++lane) {
        Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
        for_each_neighbor(first + lane, [&](int other, double weight) {
          sum += weight * edge_now(first + lane, other) * rest_edge(first + lane, other).transpose();
        });
        for (int k = 0; k < 9; ++k)
          ASSERT_NEAR(batch.sum[k][lane], sum(k / 3, k % 3), 1e-6) << "slot " << first + lane;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(AllAxes, LatticeBlocks,
                         testing::Values(BlockKind{0, 1}, BlockKind{0, 2}, BlockKind{1, 0}, BlockKind{1, 2},
                                         BlockKind{2, 0}, BlockKind{2, 1}, BlockKind{0, 1, true}));

TEST(FrameNodes, have_no_runs_where_an_edge_is_not_the_lattices) {
  Rig rig = lattice_block(0, 1);
  const int whole = row_count(FrameNodes(rig).runs);
  const LatticeRun middle = FrameNodes(rig).runs[FrameNodes(rig).runs.size() / 2];
  rig.volume.rest_positions(rig.node_of_free[middle.first + 5], 2) += 0.01 * kSpacing;
  const FrameNodes bent(rig);
  EXPECT_LE(row_count(bent.runs), whole - 15) << "the node and its neighbors";
  EXPECT_GT(row_count(bent.runs), whole / 2);
  rig.volume.interior = Interior::none;
  EXPECT_TRUE(FrameNodes(rig).runs.empty());
}

}  // namespace
}  // namespace sinew
