#pragma once

#include <optional>
#include <span>
#include <vector>

#include "skeleton/joint_match.h"

namespace sinew {

/// What one joint of a rig's spine takes from the clip's spine.
struct SpineTurn {
  int clip = -1;         ///< the clip joint it turns as
  int clip_before = -1;  ///< where turns are shared out: it lies `share` of the way from this joint's turn
  double share = 1.0;    ///< to that of `clip`
  double along = 1.0;    ///< where its bone ends on the rig's way from hips to the top of the spine, 0 to 1
};

/// Brings spines of different joint counts together, by arc length from the hips to the neck (or head, or
/// shoulders): a shorter spine's joint turns as the last of the run of clip joints it stands for, as world
/// rotations gather those below; a longer one's joints share the turns out. One entry per rig joint, set
/// for the spine's; none set when either spine has no joints or the rig's map names them.
/// `rest` and `reference` are the joints' positions in the rig and in the clip.
std::vector<std::optional<SpineTurn>> spine_turns(std::span<const Eigen::Vector3d> rest,
                                                  std::span<const Eigen::Vector3d> reference,
                                                  const JointMatch& match);

}  // namespace sinew
