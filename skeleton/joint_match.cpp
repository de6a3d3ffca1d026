#include "skeleton/joint_match.h"

#include <algorithm>

#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

BodyJoints body_by_names(const Skeleton& skeleton) {
  const RoleMap map = recognise_roles(skeleton);
  BodyJoints joints;
  std::copy(map.joint_of_role.begin(), map.joint_of_role.end(), joints.begin());
  return joints;
}

Skeleton names_and_parents(const RigSkeleton& rig) {
  Skeleton skeleton;
  for (const RigJoint& joint : rig.joints) skeleton.names.push_back(joint.name);
  skeleton.parents = rig.parents();
  skeleton.rest.resize(rig.joints.size());
  skeleton.tips.resize(rig.joints.size());
  return skeleton;
}

bool has_roles(const RigSkeleton& rig) {
  return std::any_of(rig.joints.begin(), rig.joints.end(),
                     [](const RigJoint& joint) { return joint.role.has_value(); });
}

/// Roles as the rig gives them; a rig without any (from a glTF, say) is read by its names. Animals
/// share words with humans: names count only when they tell of hips and two legs.
BodyJoints body_of_rig(const RigSkeleton& rig) {
  BodyJoints joints;
  joints.fill(-1);
  if (has_roles(rig)) {
    for (int joint = 0; joint < rig.joint_count(); ++joint)
      if (rig.joints[joint].role) joints[static_cast<int>(*rig.joints[joint].role)] = joint;
    return joints;
  }
  const BodyJoints named = body_by_names(names_and_parents(rig));
  const bool stands = joint_of(named, Role::hips) >= 0 && joint_of(named, Role::left_upper_leg) >= 0 &&
                      joint_of(named, Role::right_upper_leg) >= 0;
  return stands ? named : joints;
}

int find_by_name(const Skeleton& skeleton, const std::string& name) {
  const auto found = std::find(skeleton.names.begin(), skeleton.names.end(), name);
  return found == skeleton.names.end() ? -1 : static_cast<int>(found - skeleton.names.begin());
}

void apply_map(const Skeleton& clip, const RigSkeleton& rig, JointMatch& match) {
  for (const auto& [rig_name, clip_name] : rig.map) {
    const int rig_joint = rig.find(rig_name);
    const int clip_joint = find_by_name(clip, clip_name);
    if (rig_joint < 0)
      throw UnusableInput("the rig's [map] names its joint '" + rig_name + "', which it does not have");
    if (clip_joint < 0)
      throw UnusableInput("the rig's [map] pairs '" + rig_name + "' with '" + clip_name +
                          "', but the clip has no joint of that name");
    match.clip_of_rig[rig_joint] = clip_joint;
    const std::optional<Role> role = match.role_of_rig[rig_joint];
    if (!role) continue;
    match.clip_body[static_cast<int>(*role)] = clip_joint;
    match.spine_is_named |= *role == Role::spine || *role == Role::chest || *role == Role::upper_chest;
  }
}

bool any_of(const BodyJoints& joints, std::initializer_list<Role> roles) {
  return std::any_of(roles.begin(), roles.end(), [&](Role role) { return joint_of(joints, role) >= 0; });
}

/// What the rig has and cannot do without: hips, upper and lower limbs, some spine, neck or head.
std::vector<Role> missing_roles(const JointMatch& match) {
  std::vector<Role> missing;
  const auto need = [&](Role role) {
    if (joint_of(match.rig_body, role) >= 0 && joint_of(match.clip_body, role) < 0) missing.push_back(role);
  };
  const auto need_one = [&](std::initializer_list<Role> roles, Role name) {
    if (any_of(match.rig_body, roles) && !any_of(match.clip_body, roles)) missing.push_back(name);
  };
  need(Role::hips);
  need_one({Role::spine, Role::chest, Role::upper_chest}, Role::spine);
  need_one({Role::neck, Role::head}, Role::head);
  for (const Role role :
       {Role::left_upper_arm, Role::left_lower_arm, Role::right_upper_arm, Role::right_lower_arm,
        Role::left_upper_leg, Role::left_lower_leg, Role::right_upper_leg, Role::right_lower_leg})
    need(role);
  return missing;
}

[[noreturn]] void refuse(const std::vector<Role>& missing) {
  std::string list;
  for (const Role role : missing) list += (list.empty() ? "" : ", ") + std::string(role_name(role));
  throw UnusableInput("no joint of the clip plays " + list + "; name them in the rig file's [map]");
}

}  // namespace

std::vector<int> match_names(const Skeleton& clip, const RigSkeleton& rig) {
  std::vector<int> clip_of_rig;
  for (const RigJoint& joint : rig.joints) {
    if (std::count(clip.names.begin(), clip.names.end(), joint.name) != 1) return {};
    clip_of_rig.push_back(find_by_name(clip, joint.name));
  }
  std::vector<int> sorted = clip_of_rig;
  std::sort(sorted.begin(), sorted.end());
  const bool distinct = std::adjacent_find(sorted.begin(), sorted.end()) == sorted.end();
  return distinct ? clip_of_rig : std::vector<int>{};
}

JointMatch match_joints(const Skeleton& clip, const RigSkeleton& rig) {
  JointMatch match{body_of_rig(rig), body_by_names(clip), {}, {}};
  match.clip_of_rig.assign(rig.joints.size(), -1);
  match.role_of_rig.resize(rig.joints.size());
  for (int role = 0; role < kRoleCount; ++role)
    if (match.rig_body[role] >= 0) match.role_of_rig[match.rig_body[role]] = static_cast<Role>(role);
  if (!has_roles(rig) && rig.map.empty())
    if (std::vector<int> namesakes = match_names(clip, rig); !namesakes.empty()) {
      match.clip_of_rig = std::move(namesakes);
      return match;
    }
  apply_map(clip, rig, match);
  if (const std::vector<Role> missing = missing_roles(match); !missing.empty()) refuse(missing);
  for (int role = 0; role < kRoleCount; ++role)
    if (match.pairs(static_cast<Role>(role))) match.clip_of_rig[match.rig_body[role]] = match.clip_body[role];
  const auto follows = [](int joint) { return joint >= 0; };
  if (std::none_of(match.clip_of_rig.begin(), match.clip_of_rig.end(), follows))
    throw UnusableInput(
        "no joint of the rig has a role, a line in [map] or a namesake in the clip; "
        "name the clip's joints in the rig file's [map]");
  return match;
}

}  // namespace sinew
