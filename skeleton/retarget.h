#pragma once

#include <string>
#include <vector>

#include "skeleton/clip.h"
#include "skeleton/rig_skeleton.h"

namespace sinew {

/// Poses of a rig's skeleton over time, made continuous (see make_continuous()).
struct Motion {
  std::string name;
  double frames_per_second = 30.0;
  std::vector<Pose> poses;
  std::vector<std::string> warnings;

  int frame_count() const { return static_cast<int>(poses.size()); }
};

struct RetargetOptions {
  bool in_place = false;  ///< keep the root above its rest position on the ground plane
};

/// Moves `rig` as `clip` moves: joints matched by role or by rig.map, reference poses aligned by
/// bone direction, global rotation changes carried over, the root moved in proportion to hip
/// height. The clip's frame rate is kept. Throws UnusableInput naming the joints when the roles
/// needed do not match.
Motion retarget(const Clip& clip, const RigSkeleton& rig, const RetargetOptions& options = {});

}  // namespace sinew
