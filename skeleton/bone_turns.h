#pragma once

#include <vector>

#include "skeleton/alignment.h"

namespace sinew {

/// A direction in a clip's pose: from one joint to the mean of others, or to a point fixed in it.
struct Aim {
  int from = -1;
  std::vector<int> to;                               ///< joints; empty: `offset` counts
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  ///< in the frame of `from`

  Eigen::Vector3d direction(const Pose& pose) const;  ///< not normalised
};

/// What turns one joint of a rig.
///
/// With R the clip's world rotations, f the frame, r the reference and A the alignment's turn, the
/// rig joint's rotation from rest is  A R(f) R(r)^-1 A^-1 Q.  Q takes the bone's rest direction to the
/// clip's direction at the reference, so that the two directions agree in every frame, whatever the
/// rest poses and joint orientations are.
struct BoneTurn {
  int rig = -1;
  int clip = -1;         ///< the joint whose rotation counts
  int clip_before = -1;  ///< where the rig's spine has more joints: the turn lies `share` of the way
  double share = 1.0;    ///< from this joint's to that of `clip`
  Eigen::Quaterniond at_reference = Eigen::Quaterniond::Identity();  ///< Q
  /// Bones whose direction follows the clip exactly even where joints between its ends turn or slide:
  /// unit direction at rest, and the clip's. `aim.from` is -1 for the others.
  Eigen::Vector3d rest_direction = Eigen::Vector3d::Zero();
  Aim aim;
};

/// One entry for each rig joint that follows the clip, parents first. `frames` are the clip's poses.
std::vector<BoneTurn> bone_turns(const Skeleton& clip, std::span<const Pose> frames,
                                 const ReferencePose& reference, const RigSkeleton& rig,
                                 const JointMatch& match, const Alignment& alignment);

}  // namespace sinew
