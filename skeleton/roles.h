#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "skeleton/skeleton.h"

namespace sinew {

/// The 22-joint canon: what a joint is in a humanoid body, whatever its file calls it.
enum class Role {
  hips, spine, chest, upper_chest, neck, head,
  left_shoulder, left_upper_arm, left_lower_arm, left_hand,
  right_shoulder, right_upper_arm, right_lower_arm, right_hand,
  left_upper_leg, left_lower_leg, left_foot, left_toes,
  right_upper_leg, right_lower_leg, right_foot, right_toes,
};
constexpr int kRoleCount = 22;

/// "hips", "left_upper_arm", ...: the spelling used in rig files.
std::string_view role_name(Role role);
std::optional<Role> role_from_name(std::string_view name);

/// Which joint of a skeleton plays which role; -1 where none does.
struct RoleMap {
  std::string scheme;               ///< the naming scheme recognised, for the report
  std::vector<int> joint_of_role;   ///< kRoleCount entries
};

/// Recognises the joints of `skeleton` by name (CMU/cgspeed, Mixamo, Bandai-Namco, Daz, Poser,
/// Biped, LaFAN1, Rokoko, Unreal, Unity, VRM, MakeHuman, SMPL and kin) and by where they hang in
/// the tree: of several schemes the one that fills the most roles with parents in the right order
/// wins. Roles nobody plays are -1; the caller decides what it needs.
RoleMap recognise_roles(const Skeleton& skeleton);

}  // namespace sinew
