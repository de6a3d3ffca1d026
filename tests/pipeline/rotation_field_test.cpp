#include "pipeline/rotation_field.h"

#include <gtest/gtest.h>

#include "arm_rig.h"
#include "pipeline/orientation_diffusion.h"

namespace sinew {
namespace {

Rig arm_rig(ThreadTeam& team, Deform deform = Deform::refined) {
  return build_rig(arm_mesh(), arm_skeleton(), arm_options(deform), team);
}

RotationField blended(const Rig& rig, const Pose& pose, ThreadTeam& team) {
  PoseRotations rotations(rig.skeleton, rig.binding);
  rotations.read(pose);
  RotationField field;
  blend_rotations(rig.harmonics, rotations, team, field);
  return field;
}

/// Angle between the rotations themselves: q and -q are one.
template <typename A, typename B>
double angle_between(const Eigen::Quaternion<A>& a, const Eigen::Quaternion<B>& b) {
  return a.template cast<double>().angularDistance(b.template cast<double>()) * 180.0 / std::numbers::pi;
}

int nearest_node(const Rig& rig, const Eigen::Vector3d& point) {
  Eigen::Index node = 0;
  (rig.volume.rest_positions.rowwise() - point.transpose()).rowwise().squaredNorm().minCoeff(&node);
  return static_cast<int>(node);
}

TEST(RotationField, a_twist_is_found_whatever_swing_follows_it) {
  const Eigen::Vector3d axis = Eigen::Vector3d(1, 2, -1).normalized();
  for (const double degrees : {-200.0, 10.0, 170.0, 190.0, 300.0}) {
    const Eigen::Quaterniond swing = turn(100, axis.cross(Eigen::Vector3d::UnitX()));
    const double half = half_twist_about(swing * turn(degrees, axis), axis) * 180.0 / std::numbers::pi;
    EXPECT_NEAR(half, 0.5 * degrees, 1e-9);
  }
}

TEST(RotationField, a_half_turn_across_the_axis_has_no_twist) {
  EXPECT_NEAR(half_twist_about(turn(180, {0, 1, 0}), {1, 0, 0}), 0.0, 1e-12);
}

TEST(RotationField, one_rotation_of_all_bones_is_the_rotation_of_every_node) {
  ThreadTeam team(1);
  const Rig rig = arm_rig(team);
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond whole = turn(70, {1, 1, 0});
  for (const auto& rotation : blended(rig, posed(rig.skeleton, {whole, none, none}), team).rotations) {
    EXPECT_LT(angle_between(rotation, whole), 1e-4);
    EXPECT_NEAR(rotation.norm(), 1.0f, 1e-6f);
  }
}

TEST(RotationField, the_twist_of_the_hand_is_spread_evenly_along_the_forearm) {
  ThreadTeam team(1);
  const Rig rig = arm_rig(team);
  const RotationField field = blended(rig, bent_arm(0, 150), team);
  for (const FieldConstraint& constraint : rig.binding.field_constraints) {
    const double x = rig.volume.rest_positions(constraint.node, 0);
    const double share = std::clamp((x - 0.5) / 0.3, 0.0, 1.0);
    const Eigen::Quaterniond wanted = turn(150 * share, {1, 0, 0});
    EXPECT_LT(angle_between(field.rotations[constraint.node], wanted), 0.1) << x;
  }
}

TEST(RotationField, a_forearm_twisted_at_the_elbow_leaves_the_upper_arm_alone) {
  ThreadTeam team(1);
  const Rig rig = arm_rig(team);
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
  const RotationField field = blended(rig, posed(rig.skeleton, {none, turn(120, {1, 0, 0}), none}), team);
  EXPECT_LT(angle_between(field.rotations[nearest_node(rig, {0.3, 0, 0})], none), 1.0);
  EXPECT_LT(angle_between(field.rotations[nearest_node(rig, {0.9, 0, 0})], turn(120, {1, 0, 0})), 1.0);
}

void expect_no_jump(const Rig& rig, Pose (*pose_at)(double degrees), double most, ThreadTeam& team) {
  RotationField before = blended(rig, pose_at(0), team);
  for (int degrees = 1; degrees <= 300; ++degrees) {
    const RotationField now = blended(rig, pose_at(degrees), team);
    for (std::size_t node = 0; node < now.rotations.size(); ++node) {
      ASSERT_LT(angle_between(now.rotations[node], before.rotations[node]), most) << degrees;
    }
    before = now;
  }
}

TEST(RotationField, nothing_jumps_while_the_wrist_turns_to_300_degrees) {
  ThreadTeam team(1);
  const Rig rig = arm_rig(team);
  expect_no_jump(rig, [](double degrees) { return bent_arm(30, degrees); }, 1.5, team);
}

TEST(RotationField, nothing_jumps_while_the_elbow_bends_right_over) {
  ThreadTeam team(1);
  const Rig rig = arm_rig(team);
  // Past half a turn of swing the forearm's twist has to change by a full turn; it takes 29 degrees to.
  expect_no_jump(rig, [](double degrees) { return bent_arm(degrees, 20); }, 30.0, team);
}

TEST(RotationField, harmonic_blending_stays_close_to_orientation_diffusion) {
  ThreadTeam team(1);
  for (const Deform deform : {Deform::refined, Deform::paper}) {
    const Rig rig = arm_rig(team, deform);
    const RotationField field = blended(rig, bent_arm(90), team);
    std::vector<Eigen::Quaterniond> start;
    for (const Eigen::Quaternionf& rotation : field.rotations) start.push_back(rotation.cast<double>());
    const auto diffused = diffuse_orientations(rig.volume, rig.binding, std::move(start), 1e-6);
    for (std::size_t node = 0; node < diffused.size(); ++node) {
      EXPECT_LT(angle_between(field.rotations[node], diffused[node]), 3.0);
    }
  }
}

TEST(RotationField, scales_are_blended_with_the_same_weights) {
  ThreadTeam team(1);
  const Rig rig = arm_rig(team);
  Pose pose = rest_pose(rig.skeleton);
  pose.scales = {1.0, 1.5, 1.5};
  const RotationField field = blended(rig, pose, team);
  for (int node = 0; node < rig.volume.node_count(); ++node) {
    double upper = 0.0;
    for (int k = rig.harmonics.offsets[node]; k < rig.harmonics.offsets[node + 1]; ++k) {
      if (rig.binding.fields[rig.harmonics.fields[k]].bone == 0) upper += rig.harmonics.weights[k];
    }
    EXPECT_NEAR(field.scales[node], upper * 1.0 + (1.0 - upper) * 1.5, 1e-6);
  }
}

}  // namespace
}  // namespace sinew
