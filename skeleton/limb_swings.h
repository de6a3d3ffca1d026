#pragma once

#include <vector>

#include "skeleton/alignment.h"
#include "skeleton/bone_turns.h"

namespace sinew {

/// An arm or leg of a rig that starts nearer to the body's middle than the clip's does. With its bones
/// parallel to the clip's it would end too near as well: wrists in the hips, feet across one another. So it
/// swings outward as a whole until its end is as far out as the clip's.
struct LimbSwing {
  int upper = -1, lower = -1;              ///< rig joints of the two bones that swing
  Eigen::Vector3d upper_bone, lower_bone;  ///< at rest
  int clip_root = -1, clip_opposite = -1;  ///< where the clip's limb and its mirror image start
  double outward = 0.0;                    ///< what the limb's end lacks, as a share of the limb's length

  /// The swing, with the rig's axes for the clip's: `turn` aligns them, the bones are turned as given.
  Eigen::Quaterniond swing(const Pose& source, const Eigen::Quaterniond& turn,
                           const Eigen::Quaterniond& upper_turn, const Eigen::Quaterniond& lower_turn) const;
};

/// The limbs whose rig is narrower than the clip at the reference, by leg length. A rig that is wider
/// has room: its limbs stay as they are, and are not in the list.
std::vector<LimbSwing> limb_swings(const ReferencePose& reference, const RigSkeleton& rig,
                                   const JointMatch& match, const Alignment& alignment);

}  // namespace sinew
