#pragma once

#include <string>
#include <vector>

#include "skeleton/joint_match.h"
#include "skeleton/reference_pose.h"

namespace sinew {

/// How a clip's world lies in a rig's: turn it, then scale it.
struct Alignment {
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  double scale = 1.0;  ///< rig length per clip length: ratio of leg lengths where there are legs
};

/// Turns the clip's up to the rig's and its facing at the reference to the rig's own: for a clip
/// whose up agrees, a turn about up alone. Bodies without legs are laid over one another instead, by
/// the similarity that brings the paired joints closest [Umeyama 1991]. Adds a warning when left and
/// right of either body disagree with where it looks.
Alignment align_bodies(const ReferencePose& reference, const Eigen::Vector3d& clip_up, const RigSkeleton& rig,
                       const JointMatch& match, std::vector<std::string>& warnings);

/// Columns: left, `primary`, front; `primary` is kept exactly and `left` made square to it. Both non-zero
/// and not parallel.
Eigen::Matrix3d axes_of(const Eigen::Vector3d& primary, const Eigen::Vector3d& left);

/// The rotation that takes one set of axes to another.
Eigen::Quaterniond between_axes(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to);

/// The rotation by the least angle that takes one direction to another (any lengths but 0); opposite ones
/// leave its axis open.
Eigen::Quaterniond least_turn(const Eigen::Vector3d& from, const Eigen::Vector3d& to);

}  // namespace sinew
