#pragma once

#include <span>
#include <vector>

#include "skeleton/skeleton.h"

namespace sinew {

/// World placement of every joint at one instant.
struct Pose {
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Quaterniond> rotations;  ///< unit; q and -q differ: see make_continuous()
  std::vector<double> scales;                 ///< cube root of the world matrix's determinant; > 0

  int joint_count() const { return static_cast<int>(positions.size()); }
};

/// World matrices of all joints, from local transforms (one per joint, parents first).
std::vector<Eigen::Affine3d> world_matrices(const Skeleton& skeleton, std::span<const Transform> local);

/// Forward kinematics. Positions come from the full world matrices (so scale and shear move the
/// children as the file's author saw it), rotations are their nearest rotations.
Pose forward_kinematics(const Skeleton& skeleton, std::span<const Transform> local);

/// Chooses between q and -q over time so that nothing jumps: at the first pose each joint's rotation
/// relative to its parent has a non-negative real part; afterwards each relative rotation stays on
/// the side of the one before. A relative twist may then run through 180 degrees and on to nearly
/// 360 without a jump. `parents` as in Skeleton. Deterministic; poses in time order.
void make_continuous(std::span<Pose> poses, std::span<const int> parents);

}  // namespace sinew
