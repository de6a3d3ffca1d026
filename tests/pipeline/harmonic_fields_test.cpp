#include "pipeline/harmonic_fields.h"

#include <gtest/gtest.h>

#include "arm_rig.h"
#include "pipeline/solid.h"

namespace sinew {
namespace {

struct Fields {
  RigSkeleton skeleton;
  VolumeGraph volume;
  Binding binding;
  HarmonicFields fields;
};

Fields solved(const TriMesh& mesh, RigSkeleton skeleton, double spacing = 0.04, int threads = 1) {
  ThreadTeam team(threads);
  const Solid solid(mesh);
  VolumeGraphOptions options;
  options.spacing = spacing;
  Fields result;
  result.volume = build_volume_graph(mesh, solid, options, team);
  result.binding = bind(mesh, solid, skeleton, {}, result.volume);
  result.fields = solve_harmonic_fields(result.volume, result.binding, {}, team);
  result.skeleton = std::move(skeleton);
  return result;
}

TEST(HarmonicFields, weights_lie_between_zero_and_one_and_sum_to_one) {
  const Fields arm = solved(arm_mesh(), arm_skeleton());
  ASSERT_TRUE(arm.fields.solve.converged);
  for (int node = 0; node < arm.volume.node_count(); ++node) {
    double sum = 0.0;
    for (int k = arm.fields.offsets[node]; k < arm.fields.offsets[node + 1]; ++k) {
      EXPECT_GE(arm.fields.weights[k], 0.0f);
      EXPECT_LE(arm.fields.weights[k], 1.0f);
      const bool ascending = k == arm.fields.offsets[node] || arm.fields.fields[k] > arm.fields.fields[k - 1];
      EXPECT_TRUE(ascending);
      sum += arm.fields.weights[k];
    }
    EXPECT_NEAR(sum, 1.0, 1e-6);
  }
}

TEST(HarmonicFields, constrained_nodes_have_their_values) {
  const Fields arm = solved(arm_mesh(), arm_skeleton());
  for (const FieldConstraint& constraint : arm.binding.field_constraints) {
    EXPECT_NEAR(arm.fields.weight(constraint.node, constraint.field), constraint.value, 1e-6);
  }
}

TEST(HarmonicFields, every_other_node_has_the_mean_of_its_neighbors) {
  const Fields arm = solved(arm_mesh(), arm_skeleton());
  std::vector<bool> given(arm.volume.node_count(), false);
  for (const FieldConstraint& constraint : arm.binding.field_constraints) given[constraint.node] = true;
  for (int node = 0; node < arm.volume.node_count(); ++node) {
    if (given[node]) continue;
    for (int field = 0; field < arm.fields.field_count; ++field) {
      double mean = 0.0;
      for (const int other : arm.volume.graph.neighbors_of(node)) mean += arm.fields.weight(other, field);
      EXPECT_NEAR(arm.fields.weight(node, field), mean / arm.volume.graph.degree(node), 5e-4);  // weights below 1e-4 are dropped
    }
  }
}

TEST(HarmonicFields, fields_balance_at_a_joint_in_the_middle_of_a_limb) {
  const Fields arm = solved(arm_mesh(), arm_skeleton());
  EXPECT_TRUE(unbalanced_joints(arm.skeleton, arm.binding, arm.fields).empty());
}

TEST(HarmonicFields, a_joint_that_hardly_listens_to_its_child_is_named) {
  Binding binding;
  for (int joint = 0; joint < 3; ++joint) {
    binding.bones.push_back({.joint = joint, .segments = {}});
    binding.fields.push_back({joint, false});
  }
  binding.spheres = {{0, 1}, {1, 2}};
  HarmonicFields fields;
  fields.field_count = 3;
  fields.offsets = {0, 2, 4};
  fields.fields = {0, 1, 1, 2};
  fields.weights = {0.9f, 0.1f, 0.4f, 0.6f};
  const auto warnings = unbalanced_joints(arm_skeleton(), binding, fields);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_EQ(warnings.front(),
            "W_JOINT_UNBALANCED: at joint 'lower_arm' the body listens to 'upper_arm' by 0.90 and to 'lower_arm' by "
            "0.10; a joint in the middle of the limb gives about 0.50 each");
}

TEST(HarmonicFields, a_glued_part_listens_to_its_bone_alone) {
  const Fields arm = solved(joined(arm_mesh(), moved(samples::sphere(0.05, 1), {0.9, 0.3, 0.0})), arm_skeleton());
  ASSERT_FALSE(arm.binding.glued.empty());
  for (const auto& [node, bone] : arm.binding.glued) {
    ASSERT_EQ(arm.fields.offsets[node + 1] - arm.fields.offsets[node], 1);
    EXPECT_EQ(arm.binding.fields[arm.fields.fields[arm.fields.offsets[node]]].bone, bone);
  }
}

TEST(HarmonicFields, one_and_two_threads_give_the_same_bytes) {
  const TriMesh mesh = arm_mesh(16);
  const double fine = 0.009;  // enough nodes for multigrid
  const Fields one = solved(mesh, arm_skeleton(), fine, 1);
  const Fields two = solved(mesh, arm_skeleton(), fine, 2);
  EXPECT_TRUE(one.fields.solve.converged);
  EXPECT_GT(one.fields.solve.cycles, 0);
  EXPECT_EQ(one.fields.fields, two.fields.fields);
  EXPECT_EQ(one.fields.weights, two.fields.weights);
}

}  // namespace
}  // namespace sinew
