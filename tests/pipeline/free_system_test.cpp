#include "pipeline/free_system.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "arm_rig.h"
#include "pipeline/solid.h"

namespace sinew {
namespace {

VolumeGraph filled_arm(Interior interior) {
  ThreadTeam team(1);
  const TriMesh mesh = arm_mesh();
  VolumeGraphOptions options;
  options.interior = interior;
  options.spacing = interior == Interior::none ? 0.0 : 0.02;
  return build_volume_graph(mesh, Solid(mesh), options, team);
}

/// Every seventh node is constrained.
std::vector<bool> some_constrained(const VolumeGraph& volume) {
  std::vector<bool> constrained(volume.node_count(), false);
  for (int node = 0; node < volume.node_count(); node += 7) constrained[node] = true;
  return constrained;
}

TEST(FreeNodes, are_all_nodes_that_are_not_constrained_each_once) {
  for (const Interior interior : {Interior::lattice, Interior::none}) {
    const VolumeGraph volume = filled_arm(interior);
    const std::vector<bool> constrained = some_constrained(volume);
    const FreeNodes free = order_free_nodes(volume, constrained);
    const std::set<int> nodes(free.node_of_free.begin(), free.node_of_free.end());
    ASSERT_EQ(nodes.size(), free.node_of_free.size());
    for (int node = 0; node < volume.node_count(); ++node) {
      ASSERT_EQ(nodes.count(node), constrained[node] ? 0u : 1u);
      ASSERT_EQ(free.free_of_node[node] < 0, constrained[node]);
      if (constrained[node]) continue;
      ASSERT_EQ(free.node_of_free[free.free_of_node[node]], node);
    }
  }
}

TEST(FreeNodes, follow_the_lines_of_the_lattice) {
  const VolumeGraph volume = filled_arm(Interior::lattice);
  const FreeNodes free = order_free_nodes(volume, std::vector<bool>(volume.node_count(), false));
  int inner = 0, next_on_the_line = 0;
  for (int row = 1; row < free.count(); ++row) {
    const int before = free.node_of_free[row - 1], node = free.node_of_free[row];
    if (before < volume.surface_count || node < volume.surface_count) continue;
    ++inner;
    const Eigen::RowVector3d step = volume.rest_positions.row(node) - volume.rest_positions.row(before);
    next_on_the_line += std::abs(step.norm() - volume.spacing) < 1e-9 ? 1 : 0;
  }
  EXPECT_GT(inner, 1000);
  EXPECT_GT(next_on_the_line, inner / 2);
}

TEST(FreeNodes, come_in_layers_across_the_arm) {
  // The arm lies along x: its thinnest layers are those of x.
  const VolumeGraph volume = filled_arm(Interior::lattice);
  const FreeNodes free = order_free_nodes(volume, std::vector<bool>(volume.node_count(), false));
  double farthest = volume.rest_positions(free.node_of_free.front(), 0);
  for (const int node : free.node_of_free) {
    const double x = volume.rest_positions(node, 0);
    EXPECT_GT(x, farthest - volume.spacing / 2 - 1e-9);
    farthest = std::max(farthest, x);
  }
}

TEST(FreeNodes, of_a_body_held_everywhere_are_none) {
  const VolumeGraph volume = filled_arm(Interior::lattice);
  EXPECT_EQ(order_free_nodes(volume, std::vector<bool>(volume.node_count(), true)).count(), 0);
}

}  // namespace
}  // namespace sinew
