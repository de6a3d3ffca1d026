#include "pipeline/binding.h"

#include <gtest/gtest.h>

#include <set>

#include "arm_rig.h"
#include "pipeline/bone_regions.h"
#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

struct Bound {
  TriMesh mesh;
  RigSkeleton skeleton;
  VolumeGraph volume;
  Binding binding;
};

Bound bound(TriMesh mesh, RigSkeleton skeleton, Deform deform = Deform::refined, double spacing = 0.04,
            Interior interior = Interior::lattice) {
  ThreadTeam team(1);
  const Solid solid(mesh);
  VolumeGraphOptions options;
  options.interior = interior;
  options.spacing = spacing;
  VolumeGraph volume = build_volume_graph(mesh, solid, options, team);
  Binding binding = bind(mesh, solid, skeleton, binding_options(deform), volume);
  return {std::move(mesh), std::move(skeleton), std::move(volume), std::move(binding)};
}

Eigen::Vector3d place(const Bound& arm, int node) { return arm.volume.rest_positions.row(node).transpose(); }

TEST(Binding, a_joint_without_a_segment_is_no_bone) {
  RigSkeleton skeleton = arm_skeleton();
  skeleton.joints.back().tip.reset();
  EXPECT_EQ(bound(arm_mesh(), arm_skeleton()).binding.bones.size(), 3u);
  EXPECT_EQ(bound(arm_mesh(), skeleton).binding.bones.size(), 2u);
}

TEST(Binding, cylinders_end_before_joints_and_stay_within_their_share_of_the_thickness) {
  const Bound arm = bound(arm_mesh(24), arm_skeleton());
  for (const FieldConstraint& constraint : arm.binding.field_constraints) {
    const Eigen::Vector3d x = place(arm, constraint.node);
    EXPECT_LE(std::hypot(x.y(), x.z()), 0.6 * kArmRadius + 1e-9);
    for (const double joint : {0.0, 0.5, 0.8}) EXPECT_GE(std::abs(x.x() - joint), 1.08 * kArmRadius);
  }
}

TEST(Binding, a_root_too_short_for_its_trimming_holds_the_body_where_it_begins) {
  // Shoulder and elbow are nearer to each other than their trimming: of the upper arm a fifth is left.
  RigSkeleton skeleton = arm_skeleton();
  skeleton.joints[0].position.x() = 0.4;
  const Solid solid(arm_mesh(24));
  const BoneRegions at_root = bone_regions(solid, skeleton, {});
  EXPECT_EQ(at_root.segments[0].cylinder_begin, 0.0);
  EXPECT_EQ(at_root.segments[0].cylinder_end, 0.2);

  RigJoint trunk;
  trunk.name = "trunk";
  for (RigJoint& joint : skeleton.joints) ++joint.parent;
  skeleton.joints.insert(skeleton.joints.begin(), trunk);
  const BoneRegions between = bone_regions(solid, skeleton, {});
  EXPECT_NEAR(between.segments[1].cylinder_begin, 0.4, 1e-12);
  EXPECT_NEAR(between.segments[1].cylinder_end, 0.6, 1e-12);
}

TEST(Binding, only_interior_nodes_are_held_and_each_once) {
  const Bound arm = bound(arm_mesh(), arm_skeleton());
  std::set<int> held;
  for (const SphereConstraint& sphere : arm.binding.spheres) EXPECT_TRUE(held.insert(sphere.node).second);
  for (const CoreConstraint& core : arm.binding.cores) EXPECT_TRUE(held.insert(core.node).second);
  EXPECT_FALSE(held.empty());
  for (const int node : held) EXPECT_GE(node, arm.volume.surface_count);
  for (const FieldConstraint& constraint : arm.binding.field_constraints) {
    EXPECT_GE(constraint.node, arm.volume.surface_count);
  }
}

TEST(Binding, spheres_reach_a_little_beyond_the_thickness_and_not_half_the_bone) {
  const Bound arm = bound(arm_mesh(), arm_skeleton(), Deform::paper);
  std::vector<int> count(3, 0);
  for (const SphereConstraint& sphere : arm.binding.spheres) {
    const double distance = (place(arm, sphere.node) - arm.skeleton.joints[sphere.joint].position).norm();
    EXPECT_LE(distance, 1.1 * kArmRadius);
    ++count[sphere.joint];
  }
  for (const int nodes : count) EXPECT_GT(nodes, 3);
}

TEST(Binding, core_feet_lie_on_their_bone_and_cores_run_up_to_the_joint) {
  const Bound arm = bound(arm_mesh(), arm_skeleton());
  double nearest_to_elbow = 1.0;
  for (const CoreConstraint& core : arm.binding.cores) {
    EXPECT_NEAR(core.foot.y(), 0.0, 1e-12);
    EXPECT_LE((place(arm, core.node) - core.foot).norm(), 0.25 * kArmRadius + 1e-9);
    EXPECT_NEAR(core.foot.x(), place(arm, core.node).x(), 1e-9);
    nearest_to_elbow = std::min(nearest_to_elbow, std::abs(core.foot.x() - 0.5));
  }
  EXPECT_LT(nearest_to_elbow, 0.5 * kArmRadius);
}

TEST(Binding, the_paper_form_has_neither_cores_nor_twist_fields) {
  const Bound arm = bound(arm_mesh(), arm_skeleton(), Deform::paper);
  EXPECT_TRUE(arm.binding.cores.empty());
  EXPECT_EQ(arm.binding.fields.size(), arm.binding.bones.size());
}

TEST(Binding, a_twisting_bone_passes_from_its_near_to_its_far_field_along_its_length) {
  const Bound arm = bound(arm_mesh(), arm_skeleton());
  ASSERT_EQ(arm.binding.fields.size(), 5u);  // two for each arm bone, one for the hand
  for (const FieldConstraint& constraint : arm.binding.field_constraints) {
    const FieldSource source = arm.binding.fields[constraint.field];
    if (source.bone != 0) continue;
    const double along = place(arm, constraint.node).x() / 0.5;
    EXPECT_NEAR(constraint.value, source.far_end ? along : 1.0 - along, 1e-9);
  }
}

TEST(Binding, a_rig_without_roles_has_no_twisting_bones) {
  RigSkeleton skeleton = arm_skeleton();
  for (RigJoint& joint : skeleton.joints) joint.role.reset();
  EXPECT_EQ(bound(arm_mesh(), skeleton).binding.fields.size(), 3u);
}

TEST(Binding, the_rigs_own_radii_are_obeyed) {
  RigSkeleton skeleton = arm_skeleton();
  skeleton.joints[0].cylinder_radius = 0.03;
  skeleton.joints[1].sphere_radius = 0.05;
  const Bound arm = bound(arm_mesh(), skeleton, Deform::paper, 0.02);
  for (const FieldConstraint& constraint : arm.binding.field_constraints) {
    const Eigen::Vector3d x = place(arm, constraint.node);
    if (x.x() < 0.5) {
      EXPECT_LE(std::hypot(x.y(), x.z()), 0.03 + 1e-9);
    }
  }
  for (const SphereConstraint& sphere : arm.binding.spheres) {
    if (sphere.joint != 1) continue;
    EXPECT_LE((place(arm, sphere.node) - skeleton.joints[1].position).norm(), 0.05 + 1e-9);
  }
}

TEST(Binding, a_limb_thinner_than_the_lattice_gets_nodes_on_its_axis) {
  const double coarse = 3.0 * kArmRadius;
  const Bound arm = bound(arm_mesh(), arm_skeleton(), Deform::refined, coarse);
  int on_axis = 0;
  int tied = 0;  // to the body, not only to the next nodes on the axis
  for (const FieldConstraint& constraint : arm.binding.field_constraints) {
    const Eigen::Vector3d x = place(arm, constraint.node);
    on_axis += std::hypot(x.y(), x.z()) < 1e-12 ? 1 : 0;
    tied += arm.volume.graph.degree(constraint.node) > 2 ? 1 : 0;
  }
  EXPECT_GT(on_axis, 20);
  EXPECT_GT(2 * tied, on_axis);
  EXPECT_EQ(connected_components(arm.volume.graph).count, 1);
}

TEST(Binding, a_bare_surface_hangs_on_axis_nodes) {
  const Bound arm = bound(arm_mesh(), arm_skeleton(), Deform::refined, 0.0, Interior::none);
  EXPECT_GT(arm.volume.node_count(), arm.volume.surface_count);
  EXPECT_FALSE(arm.binding.cores.empty());
  EXPECT_TRUE(arm.binding.glued.empty());
}

TEST(Binding, a_helper_makes_its_piece_of_body_follow_the_joint) {
  RigSkeleton skeleton = arm_skeleton();
  skeleton.joints.resize(2);  // no hand: from the wrist on, a helper of the forearm instead
  skeleton.joints[1].tip = Eigen::Vector3d(0.75, 0.0, 0.0);
  skeleton.joints[1].helpers.push_back({{0.8, 0.0, 0.0}, {1.0, 0.0, 0.0}});
  const Bound arm = bound(arm_mesh(), skeleton);
  bool held = false;
  for (const FieldConstraint& constraint : arm.binding.field_constraints) {
    if (place(arm, constraint.node).x() < 0.85) continue;
    EXPECT_EQ(arm.binding.fields[constraint.field].bone, 1);
    held = true;
  }
  EXPECT_TRUE(held);
}

TEST(Binding, a_bone_holds_nothing_across_a_gap) {
  const TriMesh legs = samples::two_legs(1.0, 0.1, 0.01, 16);
  RigSkeleton skeleton;
  for (const double side : {-1.0, 1.0}) {
    RigJoint hip;
    hip.name = side < 0.0 ? "right" : "left";
    hip.position = {side * 0.105, -0.1, 0.0};
    hip.tip = Eigen::Vector3d(side * 0.105, -0.95, 0.0);
    hip.cylinder_radius = 0.5;  // far wider than the leg
    skeleton.joints.push_back(hip);
  }
  const Bound body = bound(legs, skeleton);
  for (const FieldConstraint& constraint : body.binding.field_constraints) {
    const Eigen::Vector3d x = place(body, constraint.node);
    if (x.y() > -0.2) continue;  // above the fork both legs are in sight
    EXPECT_EQ(x.x() > 0.0, body.binding.fields[constraint.field].bone == 1) << x.transpose();
  }
}

TEST(Binding, a_part_without_bone_is_glued_to_the_nearest_and_named) {
  const TriMesh both = joined(arm_mesh(), moved(samples::sphere(0.05, 1), {0.9, 0.3, 0.0}));
  const Bound arm = bound(both, arm_skeleton());
  ASSERT_FALSE(arm.binding.glued.empty());
  for (const auto& [node, bone] : arm.binding.glued) {
    EXPECT_GT(place(arm, node).y(), 0.2);
    EXPECT_EQ(bone, 2);
  }
  EXPECT_TRUE(mentions(arm.binding.warnings, "W_PART_GLUED: 1 part of the body"));
  EXPECT_TRUE(mentions(arm.binding.warnings, "it follows 'hand' rigidly"));
}

TEST(Binding, a_joint_whose_sphere_lies_within_the_cores_is_held_by_them) {
  RigSkeleton skeleton = arm_skeleton();
  skeleton.joints[1].sphere_radius = 0.015;  // cores: a quarter of 0.08
  const Bound arm = bound(arm_mesh(), skeleton, Deform::refined, 0.02);
  EXPECT_TRUE(std::none_of(arm.binding.spheres.begin(), arm.binding.spheres.end(),
                           [](const SphereConstraint& sphere) { return sphere.joint == 1; }));
  EXPECT_FALSE(mentions(arm.binding.warnings, "W_JOINT_EMPTY"));
}

TEST(Binding, a_bone_outside_the_body_is_named) {
  RigSkeleton skeleton = arm_skeleton();
  RigJoint prop;
  prop.name = "sword";
  prop.parent = 2;
  prop.position = {0.9, 0.5, 0.0};
  prop.tip = Eigen::Vector3d(0.9, 1.5, 0.0);
  skeleton.joints.push_back(prop);
  const Binding binding = bound(arm_mesh(), skeleton).binding;
  EXPECT_TRUE(mentions(binding.warnings, "W_BONE_EMPTY: bone 'sword' holds no node of the body"));
  EXPECT_TRUE(mentions(binding.warnings, "W_BONE_OUTSIDE: 100 % of bone 'sword' lies outside the body"));
  EXPECT_TRUE(mentions(binding.warnings, "W_JOINT_EMPTY: joint 'sword' holds no node of the body"));
}

TEST(Binding, a_skeleton_beside_the_mesh_is_refused) {
  RigSkeleton skeleton = arm_skeleton();
  for (RigJoint& joint : skeleton.joints) joint.position.y() += 5.0;
  skeleton.joints.back().tip->y() += 5.0;
  try {
    bound(arm_mesh(), skeleton);
    FAIL() << "not refused";
  } catch (const UnusableInput& error) {
    EXPECT_STREQ(error.what(), "no bone of the rig holds any part of the mesh; move its joints inside the mesh");
  }
}

TEST(Binding, the_recommended_spacing_puts_three_lattice_steps_across_the_thinnest_limb) {
  const TriMesh mesh = arm_mesh(8);  // edges longer than a third of the limb
  const Solid solid(mesh);
  const double spacing = recommended_spacing(mesh, solid, arm_skeleton(), {});
  const double step = 0.5 * std::sqrt(3.0) * spacing;
  EXPECT_LE(3.0 * step, 2.0 * kArmRadius + 1e-9);
  EXPECT_GT(3.0 * step, 1.5 * kArmRadius);
}

}  // namespace
}  // namespace sinew
