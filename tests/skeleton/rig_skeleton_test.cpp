#include "skeleton/rig_skeleton.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace sinew {
namespace {

RigSkeleton two_joints() {
  RigSkeleton rig;
  rig.joints.resize(2);
  rig.joints[0].name = "hips";
  rig.joints[0].position = {0, 1, 0};
  rig.joints[1].name = "chest";
  rig.joints[1].parent = 0;
  rig.joints[1].position = {0, 1.5, 0.25};
  return rig;
}

std::string refusal_of(const RigSkeleton& rig) {
  try {
    check_rig_skeleton(rig, "test");
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(RigSkeleton, lists_parents_and_finds_joints_by_name) {
  EXPECT_EQ(two_joints().parents(), (std::vector<int>{-1, 0}));
  EXPECT_EQ(two_joints().find("chest"), 1);
  EXPECT_EQ(two_joints().find("Chest"), -1);
}

TEST(RigSkeleton, rests_where_its_joints_are_without_turning) {
  const RigSkeleton rig = two_joints();
  const Pose pose = rest_pose(rig);
  ASSERT_EQ(pose.joint_count(), 2);
  for (int joint = 0; joint < 2; ++joint) {
    EXPECT_EQ(pose.positions[joint], rig.joints[joint].position);
    EXPECT_EQ(pose.rotations[joint].coeffs(), Eigen::Quaterniond::Identity().coeffs());
    EXPECT_EQ(pose.scales[joint], 1.0);
  }
}

TEST(CheckRigSkeleton, names_the_joint_that_is_wrong) {
  EXPECT_EQ(refusal_of(two_joints()), "accepted");
  RigSkeleton rig = two_joints();
  rig.joints[1].parent = 1;
  EXPECT_EQ(refusal_of(rig), "test: joint 1 'chest' has parent 1; expected -1 or a joint before it");
  rig = two_joints();
  rig.joints[0].position.y() = std::nan("");
  EXPECT_EQ(refusal_of(rig), "test: joint 0 'hips' has a position that is not finite");
  rig = two_joints();
  rig.joints[1].tip = Eigen::Vector3d(0, INFINITY, 0);
  EXPECT_EQ(refusal_of(rig), "test: joint 1 'chest' has a tip that is not finite");
  rig = two_joints();
  rig.joints[1].sphere_radius = 0.0;
  EXPECT_EQ(refusal_of(rig), "test: joint 1 'chest' has a radius that is not positive");
  rig = two_joints();
  rig.joints[1].helpers.push_back({.from = {0, 0, NAN}});
  EXPECT_EQ(refusal_of(rig), "test: joint 1 'chest' has a helper that is not finite");
  rig = two_joints();
  rig.up.setZero();
  EXPECT_EQ(refusal_of(rig), "test: the rig's up direction is not a direction");
}

}  // namespace
}  // namespace sinew
