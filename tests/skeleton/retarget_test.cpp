#include "skeleton/retarget.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "skeleton/unusable_input.h"
#include "tests/skeleton/humanoid.h"

namespace sinew {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;
using test::clip_of;
using test::humanoid_rig;
using test::posed_rig;
using test::skeleton_of;
using Turns = std::vector<Quaterniond>;

constexpr double kDegree = std::numbers::pi / 180.0;

Quaterniond turn(double degrees, const Vector3d& axis) {
  return Quaterniond(Eigen::AngleAxisd(degrees * kDegree, axis.normalized()));
}

double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) / kDegree;
}
double degrees_between(const Quaterniond& a, const Quaterniond& b) {
  return a.angularDistance(b) / kDegree;
}

/// Mixamo's names in Role order, under another namespace so that nothing matches by equal names.
std::vector<std::string> clip_names() {
  return {"m:Hips",          "m:Spine",        "m:Spine1",       "m:Spine2",      "m:Neck",
          "m:Head",          "m:LeftShoulder", "m:LeftArm",      "m:LeftForeArm", "m:LeftHand",
          "m:RightShoulder", "m:RightArm",     "m:RightForeArm", "m:RightHand",   "m:LeftUpLeg",
          "m:LeftLeg",       "m:LeftFoot",     "m:LeftToeBase",  "m:RightUpLeg",  "m:RightLeg",
          "m:RightFoot",     "m:RightToeBase"};
}

int index_of(Role role) {
  return static_cast<int>(role);
}

/// Some orientation per joint, different for each.
Turns odd_axes() {
  Turns axes;
  for (int joint = 0; joint < kRoleCount; ++joint)
    axes.push_back(turn(40.0 * joint + 10.0, Vector3d(1.0 + joint % 3, joint % 5 - 2.0, 0.5 * (joint % 2))));
  return axes;
}

bool is_foot(int joint) {
  const Role role = static_cast<Role>(joint);
  return role == Role::left_foot || role == Role::left_toes || role == Role::right_foot ||
         role == Role::right_toes;
}

/// Bends everything a little and differently, over `frames` frames; the first is at rest. Feet stay level.
std::vector<Turns> wild_motion(int frames) {
  std::vector<Turns> turns(static_cast<std::size_t>(frames), Turns(kRoleCount, Quaterniond::Identity()));
  for (int frame = 1; frame < frames; ++frame)
    for (int joint = 0; joint < kRoleCount; ++joint) {
      const Vector3d axis =
          is_foot(joint) ? Vector3d(0, 1, 0) : Vector3d(std::cos(joint), std::sin(2.0 * joint), 0.7);
      turns[frame][joint] =
          turn(35.0 * std::sin(0.4 * frame + joint), axis) * turn(7.0 * frame, Vector3d::UnitY());
    }
  return turns;
}

std::vector<Vector3d> wandering_root(int frames) {
  std::vector<Vector3d> root;
  for (int frame = 0; frame < frames; ++frame)
    root.emplace_back(0.02 * frame, 0.98 + 0.05 * std::sin(frame), 0.03 * frame);
  return root;
}

Clip wild_clip(const RigSkeleton& body, const Turns& axes, int frames = 40) {
  return clip_of(skeleton_of(body, clip_names(), axes), wild_motion(frames), wandering_root(frames));
}

/// The rig with arms hanging 40 degrees lower, one knee and the neck bent: another rest pose.
RigSkeleton another_rest(const RigSkeleton& rig) {
  Turns turns(kRoleCount, Quaterniond::Identity());
  for (int part = 1; part < 4; ++part) {
    turns[index_of(Role::left_shoulder) + part] = turn(-40, Vector3d::UnitZ());
    turns[index_of(Role::right_shoulder) + part] = turn(40, Vector3d::UnitZ());
  }
  turns[index_of(Role::left_hand)] = turn(-55, Vector3d::UnitZ());
  turns[index_of(Role::left_lower_leg)] = turns[index_of(Role::left_foot)] = turn(8, Vector3d::UnitX());
  turns[index_of(Role::neck)] = turn(-12, Vector3d::UnitX());
  turns[index_of(Role::chest)] = turn(9, Vector3d::UnitX());
  return posed_rig(rig, turns);
}

/// The same body in other units and another world: up along `turn` * y.
Clip moved_world(const Clip& clip, const Quaterniond& world, double scale) {
  Clip moved = clip;
  for (Transform& local : moved.local) local.translation *= scale;
  for (Transform& rest : moved.skeleton.rest) rest.translation *= scale;
  for (auto& tips : moved.skeleton.tips)
    for (Vector3d& tip : tips) tip *= scale;
  const auto turn_root = [&](Transform& root) {
    root.translation = world * root.translation;
    root.rotation = world * root.rotation;
  };
  turn_root(moved.skeleton.rest[0]);
  for (int frame = 0; frame < clip.frame_count; ++frame)
    turn_root(moved.local[static_cast<std::size_t>(frame * clip.skeleton.joint_count())]);
  return moved;
}

/// Bones whose direction the method promises, as pairs of roles.
const std::pair<Role, Role> kBones[] = {
    {Role::left_upper_arm, Role::left_lower_arm},   {Role::left_lower_arm, Role::left_hand},
    {Role::right_upper_arm, Role::right_lower_arm}, {Role::right_lower_arm, Role::right_hand},
    {Role::left_upper_leg, Role::left_lower_leg},   {Role::left_lower_leg, Role::left_foot},
    {Role::right_upper_leg, Role::right_lower_leg}, {Role::right_lower_leg, Role::right_foot}};

/// The largest angle between a bone in the motion and in the clip, the clip's world turned by `world`.
double worst_direction(const Clip& clip, const Motion& motion, const Quaterniond& world) {
  double worst = 0.0;
  for (int frame = 0; frame < motion.frame_count(); ++frame) {
    const Pose source = pose_at(clip, frame);
    for (const auto& [from, to] : kBones) {
      const auto bone = [&](const Pose& pose) {
        return Vector3d(pose.positions[index_of(to)] - pose.positions[index_of(from)]);
      };
      worst = std::max(worst, degrees_between(bone(motion.poses[frame]), world * bone(source)));
    }
  }
  return worst;
}

void expect_same_motion(const Motion& a, const Motion& b, double metres, double degrees) {
  ASSERT_EQ(a.frame_count(), b.frame_count());
  double distance = 0.0, angle = 0.0;
  for (int frame = 0; frame < a.frame_count(); ++frame)
    for (int joint = 0; joint < a.poses[frame].joint_count(); ++joint) {
      distance =
          std::max(distance, (a.poses[frame].positions[joint] - b.poses[frame].positions[joint]).norm());
      angle =
          std::max(angle, degrees_between(a.poses[frame].rotations[joint], b.poses[frame].rotations[joint]));
    }
  EXPECT_LE(distance, metres);
  EXPECT_LE(angle, degrees);
}

TEST(Retarget, every_bone_points_where_the_clips_bone_points_whatever_the_rest_pose_and_the_joints_axes) {
  const RigSkeleton rig = humanoid_rig();
  for (const RigSkeleton& body : {rig, another_rest(rig)})
    for (const Turns& axes : {Turns(kRoleCount, Quaterniond::Identity()), odd_axes()}) {
      const Clip clip = wild_clip(body, axes);
      EXPECT_LE(worst_direction(clip, retarget(clip, rig), Quaterniond::Identity()), 1e-6);
      EXPECT_LE(worst_direction(clip, retarget(clip, another_rest(rig)), Quaterniond::Identity()), 1e-6);
    }
}

TEST(Retarget, every_joint_turns_from_frame_to_frame_as_the_clips_joint_does) {
  const RigSkeleton rig = another_rest(humanoid_rig());
  const Clip clip = wild_clip(humanoid_rig(), odd_axes());
  const Motion motion = retarget(clip, rig);
  for (int frame = 1; frame < motion.frame_count(); ++frame) {
    const Pose before = pose_at(clip, frame - 1), now = pose_at(clip, frame);
    const Pose& moved_before = motion.poses[frame - 1];
    const Pose& moved = motion.poses[frame];
    for (int joint = 0; joint < rig.joint_count(); ++joint)
      EXPECT_LE(degrees_between(moved.rotations[joint] * moved_before.rotations[joint].conjugate(),
                                now.rotations[joint] * before.rotations[joint].conjugate()),
                1e-5)
          << rig.joints[joint].name;
  }
}

TEST(Retarget, a_declared_pose_that_stands_is_the_reference_though_a_frame_stands_straighter) {
  Turns arm_ahead(kRoleCount, Quaterniond::Identity());
  for (int part = 1; part < 4; ++part)
    arm_ahead[index_of(Role::left_shoulder) + part] = turn(-20, Vector3d::UnitY());
  const RigSkeleton declared = posed_rig(humanoid_rig(), arm_ahead);
  Turns leaning(kRoleCount, Quaterniond::Identity());
  for (int part = 1; part < 4; ++part)
    leaning[index_of(Role::left_shoulder) + part] = turn(20, Vector3d::UnitY());
  for (const Role role : {Role::spine, Role::chest, Role::upper_chest})
    leaning[index_of(role)] = turn(3, Vector3d::UnitX());
  const Clip clip = clip_of(skeleton_of(declared, clip_names(), odd_axes()), std::vector<Turns>(6, leaning),
                            std::vector<Vector3d>(6, Vector3d(0, 0.98, 0)));
  const Motion motion = retarget(clip, humanoid_rig());
  EXPECT_NEAR(degrees_between(motion.poses[3].rotations[index_of(Role::chest)], Quaterniond::Identity()), 3.0,
              1e-6);
}

TEST(Retarget, onto_the_same_body_under_other_names_is_forward_kinematics) {
  const RigSkeleton rig = humanoid_rig();
  const Clip clip = wild_clip(rig, odd_axes());
  const Motion motion = retarget(clip, rig);
  ASSERT_EQ(motion.frame_count(), clip.frame_count);
  const Pose rest = forward_kinematics(clip.skeleton, clip.skeleton.rest);
  const Vector3d shift = motion.poses[0].positions[0] - pose_at(clip, 0).positions[0];
  for (int frame = 0; frame < clip.frame_count; ++frame) {
    const Pose source = pose_at(clip, frame);
    for (int joint = 0; joint < rig.joint_count(); ++joint) {
      EXPECT_LE((motion.poses[frame].positions[joint] - source.positions[joint] - shift).norm(), 1e-9);
      EXPECT_LE(degrees_between(motion.poses[frame].rotations[joint],
                                source.rotations[joint] * rest.rotations[joint].conjugate()),
                1e-6);
    }
  }
}

TEST(Retarget, onto_the_clips_own_skeleton_keeps_place_stretch_and_joints_without_roles) {
  const RigSkeleton human = humanoid_rig();
  Clip clip = wild_clip(human, odd_axes());
  RigSkeleton rig = human;
  for (int joint = 0; joint < rig.joint_count(); ++joint) {
    clip.skeleton.names[joint] = rig.joints[joint].name = "bone " + std::to_string(joint);
    rig.joints[joint].role.reset();
    rig.joints[joint].position *= 2.0;
  }
  clip.local[5].translation *= 1.3;
  const Motion motion = retarget(clip, rig);
  for (int frame = 0; frame < clip.frame_count; ++frame) {
    const Pose source = pose_at(clip, frame);
    for (int joint = 0; joint < rig.joint_count(); ++joint)
      EXPECT_LE((motion.poses[frame].positions[joint] - 2.0 * source.positions[joint]).norm(), 1e-9);
  }
}

TEST(Retarget, units_and_world_of_the_clip_change_nothing) {
  const RigSkeleton rig = another_rest(humanoid_rig());
  const Clip clip = wild_clip(humanoid_rig(), odd_axes());
  const Motion motion = retarget(clip, rig);
  const Quaterniond z_up = turn(90, Vector3d::UnitX()), turned = turn(37, Vector3d::UnitY());
  for (const Quaterniond& world : {Quaterniond::Identity(), turned, z_up, z_up * turned,
                                   turn(180, Vector3d::UnitX()), turn(-90, Vector3d::UnitZ())}) {
    SCOPED_TRACE(world.coeffs().transpose());
    expect_same_motion(motion, retarget(moved_world(clip, world, 100.0), rig), 1e-9, 1e-6);
  }
}

TEST(Retarget, up_and_front_of_the_rig_change_nothing_but_the_world_it_moves_in) {
  const Clip clip = wild_clip(humanoid_rig(), odd_axes());
  const RigSkeleton rig = another_rest(humanoid_rig());
  const Quaterniond world = turn(90, Vector3d::UnitX()) * turn(25, Vector3d::UnitY());
  RigSkeleton moved = rig;
  moved.up = world * rig.up;
  moved.front = world * rig.front;
  for (RigJoint& joint : moved.joints) {
    joint.position = world * joint.position;
    if (joint.tip) joint.tip = world * *joint.tip;
  }
  const Motion expected = retarget(clip, rig), found = retarget(clip, moved);
  for (int frame = 0; frame < expected.frame_count(); ++frame)
    for (int joint = 0; joint < rig.joint_count(); ++joint)
      EXPECT_LE((found.poses[frame].positions[joint] - world * expected.poses[frame].positions[joint]).norm(),
                1e-9);
}

TEST(Retarget, a_bigger_body_takes_proportionally_longer_steps) {
  const Clip clip = wild_clip(humanoid_rig(), odd_axes());
  RigSkeleton giant = humanoid_rig();
  for (RigJoint& joint : giant.joints) {
    joint.position *= 3.0;
    if (joint.tip) *joint.tip *= 3.0;
  }
  const Motion human = retarget(clip, humanoid_rig()), motion = retarget(clip, giant);
  for (int frame = 0; frame < motion.frame_count(); ++frame)
    for (int joint = 0; joint < giant.joint_count(); ++joint)
      EXPECT_LE((motion.poses[frame].positions[joint] - 3.0 * human.poses[frame].positions[joint]).norm(),
                1e-9);
}

TEST(Retarget, the_lowest_foot_of_the_clip_stands_where_the_rigs_does) {
  const int frames = 40;
  std::vector<Vector3d> root(frames, Vector3d(4.0, 7.98, -2.0));  // a floor at height 7
  const Clip clip = clip_of(skeleton_of(humanoid_rig(), clip_names(), odd_axes()),
                            std::vector<Turns>(frames, Turns(kRoleCount, Quaterniond::Identity())), root);
  const RigSkeleton rig = humanoid_rig();
  const Motion motion = retarget(clip, rig);
  for (int joint = 0; joint < rig.joint_count(); ++joint)
    EXPECT_LE((motion.poses.back().positions[joint] - rig.joints[joint].position).norm(), 1e-9);
}

TEST(Retarget, in_place_keeps_the_hips_above_their_rest_position_and_their_height) {
  const Clip clip = wild_clip(humanoid_rig(), odd_axes());
  const RigSkeleton rig = another_rest(humanoid_rig());
  const Motion travelling = retarget(clip, rig), staying = retarget(clip, rig, {.in_place = true});
  for (int frame = 0; frame < staying.frame_count(); ++frame) {
    const Vector3d& hips = staying.poses[frame].positions[0];
    EXPECT_NEAR(hips.x(), rig.joints[0].position.x(), 1e-12);
    EXPECT_NEAR(hips.z(), rig.joints[0].position.z(), 1e-12);
    EXPECT_NEAR(hips.y(), travelling.poses[frame].positions[0].y(), 1e-12);
  }
}

TEST(Retarget, the_first_frame_stands_above_the_rest_position) {
  const Motion motion = retarget(wild_clip(another_rest(humanoid_rig()), odd_axes()), humanoid_rig());
  EXPECT_NEAR(motion.poses[0].positions[0].x(), 0.0, 1e-12);
  EXPECT_NEAR(motion.poses[0].positions[0].z(), 0.0, 1e-12);
}

TEST(Retarget, a_declared_pose_with_all_bones_along_one_axis_is_no_reference) {
  const RigSkeleton rig = humanoid_rig();
  Clip clip = wild_clip(rig, odd_axes());
  const Motion expected = retarget(clip, rig);
  // As in files whose channels carry the joints' orientation: without them every bone lies along x.
  for (int joint = 1; joint < clip.skeleton.joint_count(); ++joint) {
    Transform& rest = clip.skeleton.rest[joint];
    const Quaterniond along_x = Quaterniond::FromTwoVectors(Vector3d::UnitX(), rest.translation);
    const double length = rest.translation.norm();
    rest.rotation = Quaterniond::Identity();
    for (int frame = 0; frame < clip.frame_count; ++frame) {
      Transform& local = clip.local[static_cast<std::size_t>(frame * kRoleCount + joint)];
      ASSERT_LE((local.translation - along_x * Vector3d(length, 0, 0)).norm(), 1e-12);
    }
    rest.translation = Vector3d(length, 0, 0);
  }
  clip.skeleton.rest[0].rotation = Quaterniond::Identity();
  // The frames keep their own offsets: the first of them stands, and is found.
  expect_same_motion(expected, retarget(clip, rig), 1e-9, 1e-6);
}

TEST(Retarget, a_clip_that_never_stands_straight_still_points_its_bones) {
  const RigSkeleton rig = humanoid_rig();
  Turns sitting(kRoleCount, Quaterniond::Identity());
  for (const Role thigh : {Role::left_upper_leg, Role::right_upper_leg})
    sitting[index_of(thigh)] = turn(-80, Vector3d::UnitX());
  sitting[index_of(Role::left_upper_arm)] = turn(-60, Vector3d(0, 1, 1));
  const RigSkeleton seated = posed_rig(rig, sitting);
  const Clip clip = wild_clip(seated, odd_axes());
  const Motion motion = retarget(clip, rig);
  // The reference is some frame in which the body looks somewhere: one heading for the whole clip is free.
  const auto thigh = [](const Pose& pose) {
    return Vector3d(pose.positions[index_of(Role::left_lower_leg)] -
                    pose.positions[index_of(Role::left_upper_leg)]);
  };
  const Vector3d from = thigh(pose_at(clip, 0)), to = thigh(motion.poses[0]);
  const double heading = std::atan2(to.x(), to.z()) - std::atan2(from.x(), from.z());
  EXPECT_LE(worst_direction(clip, motion, Quaterniond(Eigen::AngleAxisd(heading, Vector3d::UnitY()))), 1e-6);
  ASSERT_EQ(motion.warnings.size(), 1u);
  EXPECT_EQ(motion.warnings[0].substr(0, 18), "W_REFERENCE_POSE: ");
}

TEST(Retarget, a_reference_frame_put_before_the_motion_is_left_out) {
  const RigSkeleton rig = humanoid_rig();
  Clip clip = wild_clip(rig, odd_axes());
  clip.local[0].translation =
      Vector3d::Zero();  // the T-pose stands at the origin, up to its hips in the ground
  for (int frame = 1; frame < clip.frame_count; ++frame)
    clip.local[static_cast<std::size_t>(frame * kRoleCount)].translation += Vector3d(3, 0, 3);
  const Motion motion = retarget(clip, rig);
  EXPECT_EQ(motion.frame_count(), clip.frame_count - 1);
  ASSERT_EQ(motion.warnings.size(), 1u);
  EXPECT_EQ(motion.warnings[0],
            "W_REFERENCE_FRAME_DROPPED: frame 0 is a reference pose put before the motion; left out");
  EXPECT_NEAR(motion.poses[0].positions[0].x(), 0.0, 1e-12);
}

TEST(Retarget, joints_without_roles_follow_their_parents) {
  RigSkeleton rig = humanoid_rig();
  RigJoint finger;
  finger.name = "finger";
  finger.parent = index_of(Role::left_hand);
  finger.position = Vector3d(0.8, 1.44, 0.01);
  rig.joints.push_back(finger);
  const Motion motion = retarget(wild_clip(humanoid_rig(), odd_axes()), rig);
  for (const Pose& pose : motion.poses)
    EXPECT_EQ(pose.rotations.back().coeffs(), pose.rotations[index_of(Role::left_hand)].coeffs());
}

TEST(Retarget, a_joint_above_the_hips_moves_rigidly_with_them) {
  RigSkeleton rig;
  RigJoint floor;
  floor.name = "floor";
  rig.joints.push_back(floor);
  for (RigJoint joint : humanoid_rig().joints) {
    ++joint.parent;
    rig.joints.push_back(joint);
  }
  const Motion motion = retarget(wild_clip(humanoid_rig(), odd_axes()), rig);
  for (const Pose& pose : motion.poses)
    EXPECT_LE(
        (pose.rotations[1].conjugate() * (pose.positions[0] - pose.positions[1]) - Vector3d(0, -0.98, 0))
            .norm(),
        1e-12);
}

/// A copy of `skeleton`'s clip without the joints of some roles; their children hang on their parents.
Clip without(const Clip& clip, const std::vector<Role>& roles) {
  Clip reduced = clip;
  reduced.local.clear();
  reduced.skeleton = Skeleton{};
  std::vector<int> kept, new_of_old(kRoleCount, -1);
  for (int joint = 0; joint < kRoleCount; ++joint)
    if (std::find(roles.begin(), roles.end(), static_cast<Role>(joint)) == roles.end()) {
      new_of_old[joint] = static_cast<int>(kept.size());
      kept.push_back(joint);
    }
  const auto parent_of = [&](int joint) {
    int parent = clip.skeleton.parents[joint];
    while (parent >= 0 && new_of_old[parent] < 0) parent = clip.skeleton.parents[parent];
    return parent;
  };
  const auto relative = [&](const Pose& pose, int joint) {
    const int parent = parent_of(joint);
    if (parent < 0) return Transform{pose.positions[joint], pose.rotations[joint], Vector3d::Ones()};
    return Transform{pose.rotations[parent].conjugate() * (pose.positions[joint] - pose.positions[parent]),
                     pose.rotations[parent].conjugate() * pose.rotations[joint], Vector3d::Ones()};
  };
  const Pose rest = forward_kinematics(clip.skeleton, clip.skeleton.rest);
  for (const int joint : kept) {
    reduced.skeleton.names.push_back(clip.skeleton.names[joint]);
    reduced.skeleton.parents.push_back(parent_of(joint) < 0 ? -1 : new_of_old[parent_of(joint)]);
    reduced.skeleton.rest.push_back(relative(rest, joint));
    reduced.skeleton.tips.push_back(clip.skeleton.tips[joint]);
  }
  for (int frame = 0; frame < clip.frame_count; ++frame) {
    const Pose pose = pose_at(clip, frame);
    for (const int joint : kept) reduced.local.push_back(relative(pose, joint));
  }
  return reduced;
}

TEST(Retarget, optional_joints_that_the_clip_lacks_follow_their_parents) {
  const RigSkeleton rig = humanoid_rig();
  const Clip clip = without(wild_clip(rig, odd_axes()),
                            {Role::left_shoulder, Role::left_toes, Role::right_hand, Role::neck});
  const Motion motion = retarget(clip, rig);
  for (const Pose& pose : motion.poses) {
    const auto same = [&](Role a, Role b) {
      EXPECT_LE(degrees_between(pose.rotations[index_of(a)], pose.rotations[index_of(b)]), 1e-6);
    };
    same(Role::left_shoulder, Role::upper_chest);
    same(Role::left_toes, Role::left_foot);
    same(Role::right_hand, Role::right_lower_arm);
    same(Role::neck, Role::upper_chest);
  }
}

TEST(Retarget, a_longer_spine_shares_the_turn_of_the_clips_shorter_one) {
  const RigSkeleton rig = humanoid_rig();
  Clip clip = without(wild_clip(rig, Turns(kRoleCount, Quaterniond::Identity()), 2),
                      {Role::chest, Role::upper_chest});
  for (int joint = 0; joint < clip.skeleton.joint_count(); ++joint)
    clip.local[static_cast<std::size_t>(clip.skeleton.joint_count() + joint)] =
        clip.local[static_cast<std::size_t>(joint)];
  clip.local[static_cast<std::size_t>(clip.skeleton.joint_count() + 1)].rotation =
      turn(60, Vector3d::UnitY());
  const Motion motion = retarget(clip, rig);
  const auto angle = [&](Role role) {
    return degrees_between(motion.poses[1].rotations[index_of(role)],
                           motion.poses[0].rotations[index_of(role)]);
  };
  EXPECT_NEAR(angle(Role::upper_chest), 60.0, 1e-6);
  EXPECT_GT(angle(Role::spine), 5.0);
  EXPECT_LT(angle(Role::spine), angle(Role::chest));
  EXPECT_LT(angle(Role::chest), 60.0);
}

TEST(Retarget, a_shorter_spine_takes_the_whole_turn_of_the_clips_longer_one) {
  const Clip clip = wild_clip(humanoid_rig(), odd_axes());
  RigSkeleton rig;
  for (const RigJoint& joint : humanoid_rig().joints) {  // hips, one spine joint, and the rest
    if (joint.role == Role::chest || joint.role == Role::upper_chest) continue;
    RigJoint kept = joint;
    if (kept.parent >= 4)
      kept.parent -= 2;
    else if (kept.parent >= 2)
      kept.parent = 1;
    rig.joints.push_back(kept);
  }
  const Motion motion = retarget(clip, rig);
  const Pose rest = forward_kinematics(clip.skeleton, clip.skeleton.rest);
  for (int frame = 0; frame < motion.frame_count(); ++frame) {
    const int chest = index_of(Role::upper_chest);
    EXPECT_LE(degrees_between(motion.poses[frame].rotations[1],
                              pose_at(clip, frame).rotations[chest] * rest.rotations[chest].conjugate()),
              1e-5);
  }
}

TEST(Retarget, a_trunk_at_rest_in_the_clip_is_at_rest_in_the_rig_however_both_are_shaped) {
  // The clip's body stands straight, the rig's is hunched and carries its arms lower.
  const RigSkeleton rig = another_rest(humanoid_rig());
  const Motion motion = retarget(wild_clip(humanoid_rig(), odd_axes()), rig);
  const Pose& standing = motion.poses[0];
  for (const Role role :
       {Role::hips, Role::spine, Role::chest, Role::upper_chest, Role::neck, Role::head, Role::left_shoulder})
    EXPECT_LE(degrees_between(standing.rotations[index_of(role)], Quaterniond::Identity()), 1e-6)
        << role_name(role);
}

TEST(Retarget, a_body_on_four_legs_keeps_its_trunk_level_and_its_forelegs_follow_the_arms) {
  Turns level(kRoleCount, Quaterniond::Identity());
  for (const Role role :
       {Role::spine, Role::chest, Role::upper_chest, Role::neck, Role::left_shoulder, Role::right_shoulder})
    level[index_of(role)] = turn(85, Vector3d::UnitX());
  for (int part = 1; part < 4; ++part) {
    level[index_of(Role::left_shoulder) + part] = turn(-90, Vector3d::UnitZ());
    level[index_of(Role::right_shoulder) + part] = turn(90, Vector3d::UnitZ());
  }
  const RigSkeleton rig = posed_rig(humanoid_rig(), level);
  const Clip clip = wild_clip(humanoid_rig(), odd_axes());
  const Motion motion = retarget(clip, rig);
  for (const Role role : {Role::hips, Role::spine, Role::upper_chest, Role::neck, Role::head})
    EXPECT_LE(degrees_between(motion.poses[0].rotations[index_of(role)], Quaterniond::Identity()), 1e-6);
  EXPECT_LE(worst_direction(clip, motion, Quaterniond::Identity()), 1e-6);
}

TEST(Retarget,
     a_paw_that_stands_on_its_palm_at_rest_stands_on_it_where_the_clips_hand_is_in_line_with_its_forearm) {
  RigSkeleton paws = humanoid_rig();
  for (const Role hand : {Role::left_hand, Role::right_hand})
    paws.joints[index_of(hand)].tip = paws.joints[index_of(hand)].position + Vector3d(0, 0, 0.15);
  const Clip clip = wild_clip(humanoid_rig(), odd_axes());
  expect_same_motion(retarget(clip, humanoid_rig()), retarget(clip, paws), 1e-9, 1e-6);
}

TEST(Retarget, feet_that_stand_in_the_motion_stand_on_their_soles_whatever_the_declared_pose_says) {
  Turns on_tiptoe(kRoleCount, Quaterniond::Identity());
  for (const Role foot : {Role::left_foot, Role::left_toes, Role::right_foot, Role::right_toes})
    on_tiptoe[index_of(foot)] = turn(25, Vector3d::UnitX());
  const RigSkeleton declared = posed_rig(humanoid_rig(), on_tiptoe);
  Turns flat(kRoleCount, Quaterniond::Identity());
  for (int joint = 0; joint < kRoleCount; ++joint)
    if (is_foot(joint)) flat[joint] = turn(-25, Vector3d::UnitX());
  const Clip clip = clip_of(skeleton_of(declared, clip_names(), odd_axes()), std::vector<Turns>(20, flat),
                            std::vector<Vector3d>(20, Vector3d(0, 0.98, 0)));
  const Motion motion = retarget(clip, humanoid_rig());
  for (const Role foot : {Role::left_foot, Role::right_foot})
    EXPECT_LE(degrees_between(motion.poses[10].rotations[index_of(foot)], Quaterniond::Identity()), 1e-6);
}

TEST(Retarget, toes_that_a_tracker_bends_lie_flat_when_their_foot_stands) {
  Turns bent(kRoleCount, Quaterniond::Identity());
  bent[index_of(Role::left_toes)] = turn(-25, Vector3d::UnitX());
  std::vector<Turns> frames(20, bent);
  for (int frame = 10; frame < 20; ++frame)  // lifted, the left toes bend by ten degrees more
    for (int joint = 0; joint < kRoleCount; ++joint)
      if (is_foot(joint))
        frames[frame][joint] = turn(joint == index_of(Role::left_toes) ? -15 : 20, Vector3d::UnitX());
  std::vector<Vector3d> root(20, Vector3d(0, 0.98, 0));
  for (int frame = 10; frame < 20; ++frame) root[frame].y() += 0.2;
  const Clip clip = clip_of(skeleton_of(humanoid_rig(), clip_names(), odd_axes()), frames, root);
  const Motion motion = retarget(clip, humanoid_rig());
  for (const Role toes : {Role::left_toes, Role::right_toes})
    EXPECT_LE(degrees_between(motion.poses[0].rotations[index_of(toes)], Quaterniond::Identity()), 1e-6);
  const auto bend = [&](Role toes) {
    const Role foot = static_cast<Role>(index_of(toes) - 1);
    return degrees_between(motion.poses[19].rotations[index_of(foot)],
                           motion.poses[19].rotations[index_of(toes)]);
  };
  EXPECT_NEAR(bend(Role::left_toes), 10.0, 1e-6);
  EXPECT_NEAR(bend(Role::right_toes), 0.0, 1e-6);
}

/// The clip with a second neck joint, "m:Neck1", halfway to the head. In every frame the first is bent
/// forth by `degrees` and the second back.
Clip with_second_neck(const Clip& clip, double degrees) {
  const int neck = index_of(Role::neck), head = index_of(Role::head), count = clip.skeleton.joint_count();
  const Quaterniond bend = turn(degrees, Vector3d::UnitX());
  const auto insert = [&](auto& list, int at, const auto& item) { list.insert(list.begin() + at, item); };
  Clip longer = clip;
  longer.skeleton.rest[head].translation *= 0.5;
  insert(longer.skeleton.names, head, std::string("m:Neck1"));
  insert(longer.skeleton.parents, head, neck);
  insert(longer.skeleton.tips, head, std::vector<Vector3d>{});
  insert(longer.skeleton.rest, head,
         Transform{longer.skeleton.rest[head].translation, {1, 0, 0, 0}, Vector3d::Ones()});
  for (int joint = head + 1; joint <= count; ++joint)
    if (joint == head + 1 || longer.skeleton.parents[joint] >= head) ++longer.skeleton.parents[joint];
  for (int frame = clip.frame_count - 1; frame >= 0; --frame) {
    const auto first = static_cast<std::size_t>(frame) * static_cast<std::size_t>(count);
    longer.local[first + neck].rotation = longer.local[first + neck].rotation * bend;
    longer.local[first + head].translation *= 0.5;
    insert(longer.local, static_cast<int>(first) + head,
           Transform{longer.local[first + head].translation, bend.conjugate(), Vector3d::Ones()});
  }
  return longer;
}

TEST(Retarget, a_neck_takes_what_two_neck_joints_of_the_clip_turn_together) {
  const Clip clip = wild_clip(humanoid_rig(), Turns(kRoleCount, Quaterniond::Identity()));
  const Clip longer = with_second_neck(clip, 25.0);
  RigSkeleton rig = humanoid_rig();
  const Motion expected = retarget(clip, rig), found = retarget(longer, rig);
  rig.map = {{"neck", "m:Neck"}};
  const Motion by_name = retarget(longer, rig);
  for (int frame = 0; frame < clip.frame_count; ++frame) {
    const auto neck_turn = [&](const Motion& motion) {
      return degrees_between(motion.poses[frame].rotations[index_of(Role::neck)],
                             expected.poses[frame].rotations[index_of(Role::neck)]);
    };
    EXPECT_LE(neck_turn(found), 1e-6);
    EXPECT_NEAR(neck_turn(by_name), 25.0, 1e-6);
  }
}

/// The rig with arms and legs moved towards the middle by `metres` each.
RigSkeleton narrowed(RigSkeleton rig, double metres) {
  for (RigJoint& joint : rig.joints) {
    const int part = index_of(*joint.role);
    const bool arm = part > index_of(Role::left_shoulder) && part <= index_of(Role::right_hand) &&
                     joint.role != Role::right_shoulder;
    if (!arm && part < index_of(Role::left_upper_leg)) continue;
    const double inward = joint.position.x() > 0 ? -metres : metres;
    joint.position.x() += inward;
    if (joint.tip) joint.tip->x() += inward;
  }
  return rig;
}

/// Arms hang, elbows and knees are a little bent; thighs lean together.
Clip hanging_clip() {
  Turns turns(kRoleCount, Quaterniond::Identity());
  for (int part = 1; part < 4; ++part) {
    const Quaterniond elbow = part > 1 ? turn(-20, Vector3d::UnitX()) : Quaterniond::Identity();
    turns[index_of(Role::left_shoulder) + part] = elbow * turn(-85, Vector3d::UnitZ());
    turns[index_of(Role::right_shoulder) + part] = elbow * turn(85, Vector3d::UnitZ());
  }
  turns[index_of(Role::left_upper_leg)] = turn(-4, Vector3d::UnitZ()) * turn(-10, Vector3d::UnitX());
  turns[index_of(Role::right_upper_leg)] = turn(4, Vector3d::UnitZ()) * turn(-10, Vector3d::UnitX());
  return clip_of(skeleton_of(humanoid_rig(), clip_names(), odd_axes()), std::vector<Turns>(6, turns),
                 std::vector<Vector3d>(6, Vector3d(0, 0.98, 0)));
}

const Role kEnds[] = {Role::left_hand, Role::right_hand, Role::left_foot, Role::right_foot};

TEST(Retarget, hands_and_feet_of_a_narrower_body_are_as_far_out_as_the_clips) {
  const Clip clip = hanging_clip();
  const Pose source = pose_at(clip, 3);
  const RigSkeleton rig = narrowed(humanoid_rig(), 0.02);
  const Motion motion = retarget(clip, rig), parallel = retarget(clip, rig, {.limb_swings = false});
  for (const Role end : kEnds) {
    const double side = index_of(end) <= index_of(Role::left_hand) || end == Role::left_foot ? 1.0 : -1.0;
    const auto out = [&](const Pose& pose) {
      return side * (pose.positions[index_of(end)] - pose.positions[0]).x();
    };
    EXPECT_NEAR(out(motion.poses[3]), out(source), 1e-3) << role_name(end);
    EXPECT_NEAR(out(parallel.poses[3]), out(source) - 0.02, 1e-6) << role_name(end);
    EXPECT_LE(
        degrees_between(motion.poses[3].rotations[index_of(end)], parallel.poses[3].rotations[index_of(end)]),
        1e-6)
        << "a swing is of the limb alone, " << role_name(end);
  }
  EXPECT_LE(worst_direction(clip, parallel, Quaterniond::Identity()), 1e-6);
}

TEST(Retarget, limbs_swing_five_degrees_at_most_and_those_of_a_wider_body_not_at_all) {
  const Clip clip = hanging_clip();
  const double most =
      worst_direction(clip, retarget(clip, narrowed(humanoid_rig(), 0.08)), Quaterniond::Identity());
  EXPECT_NEAR(most, 5.0, 0.2);
  EXPECT_LE(worst_direction(clip, retarget(clip, narrowed(humanoid_rig(), -0.08)), Quaterniond::Identity()),
            1e-6);
}

TEST(Retarget, the_map_of_the_rig_file_wins_over_roles) {
  const RigSkeleton body = humanoid_rig();
  Clip clip = wild_clip(body, odd_axes());
  const Motion expected = retarget(clip, body);
  clip.skeleton.names[index_of(Role::left_lower_arm)] = "joint X";
  clip.skeleton.names[index_of(Role::right_upper_leg)] = "joint Y";
  RigSkeleton rig = body;
  rig.map = {{"left_lower_arm", "joint X"}, {"right_upper_leg", "joint Y"}};
  expect_same_motion(expected, retarget(clip, rig), 1e-12, 1e-9);
}

TEST(Retarget, an_animal_moves_by_the_map_alone) {
  // A spine and two legs of some animal, without roles.
  RigSkeleton rig;
  const std::tuple<const char*, int, Vector3d> joints[] = {{"body", -1, {0, 1, 0}},
                                                           {"tail", 0, {0, 1.1, -0.5}},
                                                           {"tail tip", 1, {0, 1.2, -1}},
                                                           {"leg", 0, {0.2, 0.9, 0}},
                                                           {"hoof", 3, {0.2, 0.1, 0}}};
  for (const auto& [name, parent, position] : joints) {
    RigJoint joint;
    joint.name = name;
    joint.parent = parent;
    joint.position = position;
    rig.joints.push_back(joint);
  }
  std::vector<std::string> names = {"Körper", "Schwanz", "Spitze", "Bein", "Huf"};
  const Skeleton skeleton = skeleton_of(rig, names, Turns(5, turn(30, Vector3d(1, 2, 3))));
  std::vector<Turns> turns(6, Turns(5, Quaterniond::Identity()));
  for (int frame = 1; frame < 6; ++frame)
    for (int joint = 0; joint < 5; ++joint) turns[frame][joint] = turn(10.0 * frame, Vector3d(1, joint, 0));
  const Clip clip = clip_of(skeleton, turns, std::vector<Vector3d>(6, Vector3d(0, 1, 0)));
  for (int joint = 0; joint < 5; ++joint) rig.map.emplace_back(rig.joints[joint].name, names[joint]);
  const Motion motion = retarget(clip, rig);
  for (int frame = 0; frame < 6; ++frame)
    for (int joint = 0; joint < 5; ++joint)
      EXPECT_LE(degrees_between(motion.poses[frame].rotations[joint], turns[frame][joint]), 1e-5);
}

TEST(Retarget, rotations_are_unit_and_scales_are_one) {
  for (const Pose& pose : retarget(wild_clip(another_rest(humanoid_rig()), odd_axes()), humanoid_rig()).poses)
    for (int joint = 0; joint < pose.joint_count(); ++joint) {
      EXPECT_NEAR(pose.rotations[joint].norm(), 1.0, 1e-12);
      EXPECT_EQ(pose.scales[joint], 1.0);
    }
}

TEST(Retarget, twice_gives_the_same_bits) {
  const Clip clip = wild_clip(another_rest(humanoid_rig()), odd_axes());
  const Motion first = retarget(clip, humanoid_rig()), second = retarget(clip, humanoid_rig());
  for (int frame = 0; frame < first.frame_count(); ++frame)
    for (int joint = 0; joint < kRoleCount; ++joint) {
      EXPECT_EQ(first.poses[frame].positions[joint], second.poses[frame].positions[joint]);
      EXPECT_EQ(first.poses[frame].rotations[joint].coeffs(), second.poses[frame].rotations[joint].coeffs());
    }
}

std::string refusal(const Clip& clip, const RigSkeleton& rig) {
  try {
    retarget(clip, rig);
  } catch (const UnusableInput& refused) {
    return refused.what();
  }
  return "accepted";
}

TEST(Retarget, refuses_a_clip_that_lacks_limbs_of_the_rig_and_names_them) {
  Clip clip = wild_clip(humanoid_rig(), odd_axes());
  clip.skeleton.names[index_of(Role::left_upper_leg)] = "A";
  clip.skeleton.names[index_of(Role::right_lower_arm)] = "B";
  EXPECT_EQ(refusal(clip, humanoid_rig()),
            "no joint of the clip plays right_lower_arm, left_upper_leg; name them in the rig file's [map]");
}

TEST(Retarget, refuses_a_map_that_names_joints_that_are_not_there) {
  const Clip clip = wild_clip(humanoid_rig(), odd_axes());
  RigSkeleton rig = humanoid_rig();
  rig.map = {{"left_hand", "Pfote"}};
  EXPECT_EQ(refusal(clip, rig),
            "the rig's [map] pairs 'left_hand' with 'Pfote', but the clip has no joint of that name");
  rig.map = {{"paw", "m:LeftHand"}};
  EXPECT_EQ(refusal(clip, rig), "the rig's [map] names its joint 'paw', which it does not have");
}

TEST(Retarget, refuses_a_rig_that_has_nothing_in_common_with_the_clip) {
  RigSkeleton rig;
  rig.joints.resize(2);
  rig.joints[0].name = "a";
  rig.joints[1].name = "b";
  EXPECT_EQ(refusal(wild_clip(humanoid_rig(), odd_axes()), rig),
            "no joint of the rig has a role, a line in [map] or a namesake in the clip; "
            "name the clip's joints in the rig file's [map]");
}

TEST(Retarget, refuses_a_clip_without_frames_and_a_rig_without_joints) {
  Clip clip = wild_clip(humanoid_rig(), odd_axes());
  EXPECT_EQ(refusal(clip, RigSkeleton{}), "the rig has no joints");
  clip.frame_count = 0;
  EXPECT_EQ(refusal(clip, humanoid_rig()), "the clip 'made up' has no frames");
}

}  // namespace
}  // namespace sinew
