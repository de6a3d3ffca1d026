#pragma once

#include <vector>

#include "skeleton/body.h"
#include "skeleton/clip.h"
#include "skeleton/rig_skeleton.h"

namespace sinew {

/// Which joint of a clip each joint of a rig follows.
struct JointMatch {
  BodyJoints rig_body;           ///< by the rig's roles, or by its names where it has no roles
  BodyJoints clip_body;          ///< by the clip's names, corrected by the rig's map
  std::vector<int> clip_of_rig;  ///< rig joint_count; -1 where the rig joint follows its parent
  std::vector<std::optional<Role>> role_of_rig;
  bool spine_is_named = false;  ///< the map names a spine joint: take the spine as it says

  /// Whether both bodies have this landmark.
  bool pairs(Role role) const { return joint_of(rig_body, role) >= 0 && joint_of(clip_body, role) >= 0; }
};

/// A rig with neither roles nor map whose joints all have namesakes pairs by name. Otherwise the map
/// decides, then the roles. Throws UnusableInput when nothing pairs, when the map names a joint that
/// is not there, or when the clip lacks a limb that the rig has.
JointMatch match_joints(const Skeleton& clip, const RigSkeleton& rig);

/// For a rig each of whose joints has exactly one namesake in the clip: those namesakes. Else empty.
std::vector<int> match_names(const Skeleton& clip, const RigSkeleton& rig);

}  // namespace sinew
