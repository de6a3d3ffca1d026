#pragma once

#include <string>
#include <utility>
#include <vector>

#include "skeleton/clip.h"
#include "skeleton/rig_skeleton.h"

namespace sinew::test {

/// A joint of the made-up human: y up, looking along +z, arms out (T), 1.8 m tall, soles at y = 0.
struct HumanoidJoint {
  Role role;
  int parent;  ///< index in the list
  Eigen::Vector3d position;
};

/// The 22 joints of the canon in Role order; parents come before children.
inline std::vector<HumanoidJoint> humanoid_joints() {
  using enum Role;
  std::vector<HumanoidJoint> joints = {
      {hips, -1, {0, 0.98, 0}},           {spine, 0, {0, 1.08, -0.01}}, {chest, 1, {0, 1.20, -0.02}},
      {upper_chest, 2, {0, 1.33, -0.02}}, {neck, 3, {0, 1.50, -0.02}},  {head, 4, {0, 1.60, 0.01}},
  };
  for (const double side : {1.0, -1.0}) {
    const int first = static_cast<int>(joints.size());
    const Role shoulder = side > 0 ? left_shoulder : right_shoulder;
    const std::vector<Eigen::Vector3d> arm = {{0.03 * side, 1.44, 0},
                                              {0.18 * side, 1.45, -0.02},
                                              {0.46 * side, 1.45, -0.03},
                                              {0.72 * side, 1.45, -0.01}};
    for (int part = 0; part < 4; ++part)
      joints.push_back({static_cast<Role>(static_cast<int>(shoulder) + part),
                        part == 0 ? 3 : first + part - 1, arm[part]});
  }
  for (const double side : {1.0, -1.0}) {
    const int first = static_cast<int>(joints.size());
    const Role thigh = side > 0 ? left_upper_leg : right_upper_leg;
    const std::vector<Eigen::Vector3d> leg = {{0.09 * side, 0.92, 0},
                                              {0.10 * side, 0.50, 0.01},
                                              {0.10 * side, 0.08, -0.02},
                                              {0.11 * side, 0.02, 0.12}};
    for (int part = 0; part < 4; ++part)
      joints.push_back(
          {static_cast<Role>(static_cast<int>(thigh) + part), part == 0 ? 0 : first + part - 1, leg[part]});
  }
  return joints;
}

/// A rig of it with roles, a crown, finger tips and toe tips; its joints are named after their roles.
inline RigSkeleton humanoid_rig() {
  RigSkeleton rig;
  for (const HumanoidJoint& joint : humanoid_joints()) {
    RigJoint made;
    made.name = std::string(role_name(joint.role));
    made.parent = joint.parent;
    made.position = joint.position;
    made.role = joint.role;
    const double side = joint.position.x() > 0 ? 1.0 : -1.0;
    if (joint.role == Role::head) made.tip = Eigen::Vector3d(0, 1.80, 0.01);
    if (joint.role == Role::left_hand || joint.role == Role::right_hand)
      made.tip = Eigen::Vector3d(0.90 * side, 1.44, 0);
    if (joint.role == Role::left_toes || joint.role == Role::right_toes)
      made.tip = Eigen::Vector3d(0.11 * side, 0.01, 0.19);
    rig.joints.push_back(std::move(made));
  }
  return rig;
}

/// The rig's joints turned about themselves: every bone keeps its length and points where `turns` (one
/// world rotation per joint) takes its rest direction. The root keeps its place.
inline RigSkeleton posed_rig(RigSkeleton rig, const std::vector<Eigen::Quaterniond>& turns) {
  const RigSkeleton rest = rig;
  for (int joint = 0; joint < rig.joint_count(); ++joint) {
    RigJoint& moved = rig.joints[joint];
    if (moved.parent >= 0)
      moved.position =
          rig.joints[moved.parent].position +
          turns[moved.parent] * (rest.joints[joint].position - rest.joints[moved.parent].position);
    if (moved.tip)
      moved.tip = moved.position + turns[joint] * (*rest.joints[joint].tip - rest.joints[joint].position);
  }
  return rig;
}

/// A skeleton with these world positions, every joint's own axes turned by `axes` (one per joint) at rest.
inline Skeleton skeleton_of(const RigSkeleton& rig, const std::vector<std::string>& names,
                            const std::vector<Eigen::Quaterniond>& axes) {
  Skeleton skeleton;
  skeleton.names = names;
  skeleton.parents = rig.parents();
  for (int joint = 0; joint < rig.joint_count(); ++joint) {
    const int parent = skeleton.parents[joint];
    Transform rest;
    rest.translation = rig.joints[joint].position;
    rest.rotation = axes[joint];
    if (parent >= 0) {
      rest.translation =
          axes[parent].conjugate() * (rig.joints[joint].position - rig.joints[parent].position);
      rest.rotation = axes[parent].conjugate() * axes[joint];
    }
    skeleton.rest.push_back(rest);
    skeleton.tips.emplace_back();
    if (rig.joints[joint].tip)
      skeleton.tips.back().push_back(axes[joint].conjugate() *
                                     (*rig.joints[joint].tip - rig.joints[joint].position));
  }
  return skeleton;
}

/// A clip that turns each joint of `skeleton` from rest by world rotations `turns[frame][joint]`, its root
/// at `root[frame]`.
inline Clip clip_of(const Skeleton& skeleton, const std::vector<std::vector<Eigen::Quaterniond>>& turns,
                    const std::vector<Eigen::Vector3d>& root) {
  Clip clip;
  clip.name = "made up";
  clip.skeleton = skeleton;
  clip.frame_count = static_cast<int>(turns.size());
  const Pose rest = forward_kinematics(skeleton, skeleton.rest);
  for (std::size_t frame = 0; frame < turns.size(); ++frame) {
    for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
      const int parent = skeleton.parents[joint];
      const Eigen::Quaterniond own = turns[frame][joint] * rest.rotations[joint];
      Transform local = skeleton.rest[joint];
      local.rotation = parent < 0 ? own : (turns[frame][parent] * rest.rotations[parent]).conjugate() * own;
      if (parent < 0) local.translation = root[frame];
      clip.local.push_back(local);
    }
  }
  return clip;
}

}  // namespace sinew::test
