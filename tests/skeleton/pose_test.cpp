#include "skeleton/pose.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/skeleton/chains.h"

namespace sinew {
namespace {

using chains::figure;
using chains::turn_about_x;
using chains::turn_about_z;

/// Bends everything: the figure with each joint turned and the root moved.
std::vector<Transform> bent(const Skeleton& skeleton) {
  std::vector<Transform> local = skeleton.rest;
  local[0].translation = {3, 4, 5};
  for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
    local[joint].rotation = turn_about_z(20.0 + 30.0 * joint) * turn_about_x(10.0 - 45.0 * joint);
  }
  return local;
}

TEST(ForwardKinematics, of_rest_adds_the_offsets_up) {
  const Pose pose = forward_kinematics(figure(), figure().rest);
  const std::vector<Eigen::Vector3d> expected = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {0, -1, 0}};
  EXPECT_EQ(pose.positions, expected);
  for (const Eigen::Quaterniond& rotation : pose.rotations) EXPECT_EQ(rotation.w(), 1.0);
  EXPECT_EQ(pose.scales, std::vector<double>(4, 1.0));
}

TEST(ForwardKinematics, turning_a_joint_carries_all_below_it_and_nothing_else) {
  std::vector<Transform> local = figure().rest;
  local[1].rotation = turn_about_z(90);
  const Pose pose = forward_kinematics(figure(), local);
  EXPECT_LT((pose.positions[1] - Eigen::Vector3d(1, 0, 0)).norm(), 1e-15);
  EXPECT_LT((pose.positions[2] - Eigen::Vector3d(1, 1, 0)).norm(), 1e-15);
  EXPECT_LT((pose.positions[3] - Eigen::Vector3d(0, -1, 0)).norm(), 1e-15);
}

TEST(ForwardKinematics, keeps_the_lengths_of_bones_under_rotation) {
  const Pose pose = forward_kinematics(figure(), bent(figure()));
  EXPECT_NEAR((pose.positions[1] - pose.positions[0]).norm(), 1.0, 1e-14);
  EXPECT_NEAR((pose.positions[2] - pose.positions[1]).norm(), 1.0, 1e-14);
  EXPECT_NEAR((pose.positions[3] - pose.positions[0]).norm(), 1.0, 1e-14);
}

TEST(ForwardKinematics, moving_the_root_moves_the_whole_rigidly) {
  const std::vector<Transform> local = bent(figure());
  std::vector<Transform> moved = local;
  const Eigen::Isometry3d motion = Eigen::Translation3d(1, 2, 3) * turn_about_x(77) * turn_about_z(13);
  moved[0].translation = motion * local[0].translation;
  moved[0].rotation = Eigen::Quaterniond(motion.linear()) * local[0].rotation;
  const Pose before = forward_kinematics(figure(), local);
  const Pose after = forward_kinematics(figure(), moved);
  for (int joint = 0; joint < 4; ++joint) {
    EXPECT_LT((after.positions[joint] - motion * before.positions[joint]).norm(), 1e-13);
    EXPECT_LT(after.rotations[joint].angularDistance(Eigen::Quaterniond(motion.linear()) * before.rotations[joint]), 1e-7);
  }
}

TEST(ForwardKinematics, agrees_with_the_world_matrices) {
  std::vector<Transform> local = bent(figure());
  local[0].scale = {2, 2, 2};
  local[1].scale = {1, 3, 0.5};
  const std::vector<Eigen::Affine3d> world = world_matrices(figure(), local);
  const Pose pose = forward_kinematics(figure(), local);
  for (int joint = 0; joint < 4; ++joint) {
    EXPECT_LT((pose.positions[joint] - world[joint].translation()).norm(), 1e-13);
    EXPECT_LT(pose.rotations[joint].angularDistance(nearest_rotation(world[joint].linear())), 1e-7);
  }
  EXPECT_NEAR(pose.scales[0], 2.0, 1e-13);
  EXPECT_NEAR(pose.scales[1], 2.0 * std::cbrt(1.5), 1e-13);
  EXPECT_NEAR(pose.scales[2], 2.0 * std::cbrt(1.5), 1e-13);
  EXPECT_NEAR(pose.scales[3], 2.0, 1e-13);
}

TEST(ForwardKinematics, without_scale_multiplies_to_what_the_matrices_say) {
  const std::vector<Transform> local = bent(figure());
  const std::vector<Eigen::Affine3d> world = world_matrices(figure(), local);
  const Pose pose = forward_kinematics(figure(), local);
  for (int joint = 0; joint < 4; ++joint) {
    EXPECT_LT((pose.rotations[joint].toRotationMatrix() - world[joint].linear()).norm(), 1e-14);
  }
}

TEST(ForwardKinematics, reports_a_positive_scale_for_mirrored_and_vanished_joints) {
  std::vector<Transform> local = figure().rest;
  local[1].scale = {-2, 2, 2};
  local[3].scale = {0, 0, 0};
  const Pose pose = forward_kinematics(figure(), local);
  EXPECT_NEAR(pose.scales[1], 2.0, 1e-14);
  EXPECT_GT(pose.scales[3], 0.0);
  EXPECT_NEAR(pose.rotations[3].norm(), 1.0, 1e-14);
}

TEST(ForwardKinematics, follows_a_chain_of_a_hundred_thousand_joints) {
  constexpr int kJoints = 100'000;
  Skeleton chain;
  for (int joint = 0; joint < kJoints; ++joint) chain.parents.push_back(joint - 1);
  chain.names.resize(kJoints);
  chain.tips.resize(kJoints);
  chain.rest.assign(kJoints, {.translation = {1, 0, 0}, .rotation = turn_about_z(0.25)});
  const Pose pose = forward_kinematics(chain, chain.rest);
  EXPECT_NEAR(pose.rotations.back().norm(), 1.0, 1e-14);
  EXPECT_LT(pose.positions.back().norm(), 1000.0);  // it winds round a circle of radius 230
}

TEST(ForwardKinematics, refuses_another_number_of_transforms) {
  try {
    forward_kinematics(figure(), std::vector<Transform>(3));
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "forward_kinematics: 3 transforms for 4 joints; expected one per joint");
  }
}

/// Poses of a two-joint chain: the parent turned by `parent_degrees`, the child by that and by
/// `twist_degrees` more, about x. Signs alternate so that there is something to repair.
std::vector<Pose> twisting(const std::vector<double>& parent_degrees, const std::vector<double>& twist_degrees) {
  std::vector<Pose> poses;
  for (std::size_t frame = 0; frame < twist_degrees.size(); ++frame) {
    Pose pose{{{0, 0, 0}, {1, 0, 0}},
              {turn_about_x(parent_degrees[frame]), turn_about_x(parent_degrees[frame] + twist_degrees[frame])},
              {1.0, 1.0}};
    if (frame % 2 == 1) pose.rotations[0].coeffs() *= -1.0;
    if (frame % 3 == 1) pose.rotations[1].coeffs() *= -1.0;
    poses.push_back(pose);
  }
  return poses;
}

/// Signed angle of the child's rotation relative to its parent about x, in degrees, 0 to 360.
double twist_of(const Pose& pose) {
  const Eigen::Quaterniond relative = pose.rotations[0].conjugate() * pose.rotations[1];
  return 2.0 * std::atan2(relative.x(), relative.w()) * 180.0 / std::numbers::pi;
}

TEST(MakeContinuous, lets_a_relative_twist_run_to_350_degrees_without_a_jump) {
  for (const double parent_step : {0.0, -11.0, 200.0}) {  // the body may turn as it likes meanwhile
    std::vector<double> parent;
    std::vector<double> twist;
    for (int step = 0; step <= 70; ++step) {
      parent.push_back(parent_step * step);
      twist.push_back(5.0 * step);
    }
    std::vector<Pose> poses = twisting(parent, twist);
    make_continuous(poses, std::vector<int>{-1, 0});
    for (int step = 0; step <= 70; ++step) EXPECT_NEAR(twist_of(poses[step]), 5.0 * step, 1e-9);
  }
}

TEST(MakeContinuous, starts_with_real_parts_that_are_not_negative) {
  std::vector<Pose> poses = twisting({100.0}, {100.0});
  for (Eigen::Quaterniond& rotation : poses[0].rotations) rotation.coeffs() *= -1.0;
  make_continuous(poses, std::vector<int>{-1, 0});
  EXPECT_GE(poses[0].rotations[0].w(), 0.0);
  EXPECT_GE((poses[0].rotations[0].conjugate() * poses[0].rotations[1]).w(), 0.0);
}

TEST(MakeContinuous, keeps_each_relative_rotation_on_the_side_of_the_one_before) {
  const Skeleton skeleton = figure();
  std::vector<Pose> poses;
  for (int frame = 0; frame < 200; ++frame) {
    std::vector<Transform> local = skeleton.rest;
    for (int joint = 0; joint < 4; ++joint) {
      local[joint].rotation = turn_about_z(frame * (3.0 + joint)) * turn_about_x(frame * (7.0 - 2.0 * joint));
    }
    poses.push_back(forward_kinematics(skeleton, local));
    poses.back().rotations[frame % 4].coeffs() *= -1.0;
  }
  const std::vector<Pose> before = poses;
  make_continuous(poses, skeleton.parents);
  const auto relative = [&](const Pose& pose, int joint) {
    const int parent = skeleton.parents[joint];
    return parent < 0 ? pose.rotations[joint] : pose.rotations[parent].conjugate() * pose.rotations[joint];
  };
  for (std::size_t frame = 0; frame < poses.size(); ++frame) {
    for (int joint = 0; joint < 4; ++joint) {
      EXPECT_EQ(std::abs(poses[frame].rotations[joint].dot(before[frame].rotations[joint])),
                before[frame].rotations[joint].squaredNorm());  // the same rotation still
      if (frame == 0) continue;
      EXPECT_GE(relative(poses[frame], joint).dot(relative(poses[frame - 1], joint)), 0.0);
    }
  }
}

TEST(MakeContinuous, does_not_depend_on_the_signs_it_is_given) {
  std::vector<double> angles;
  for (int step = 0; step < 50; ++step) angles.push_back(9.0 * step);
  std::vector<Pose> one = twisting(angles, angles);
  std::vector<Pose> other = one;
  for (std::size_t frame = 0; frame < other.size(); frame += 5) other[frame].rotations[1].coeffs() *= -1.0;
  make_continuous(one, std::vector<int>{-1, 0});
  make_continuous(other, std::vector<int>{-1, 0});
  for (std::size_t frame = 0; frame < one.size(); ++frame) {
    EXPECT_EQ(one[frame].rotations[1].coeffs(), other[frame].rotations[1].coeffs());
  }
}

TEST(MakeContinuous, refuses_poses_of_another_skeleton) {
  std::vector<Pose> poses = twisting({0.0}, {0.0});
  try {
    make_continuous(poses, std::vector<int>{-1, 0, 1});
    FAIL() << "accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "make_continuous: a pose has 2 joints; expected 3");
  }
}

}  // namespace
}  // namespace sinew
