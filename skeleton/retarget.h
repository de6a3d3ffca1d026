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
  bool in_place = false;    ///< keep the root above its rest position on the ground plane
  bool limb_swings = true;  ///< off: limbs of a narrower body point exactly where the clip's do
};

/// Moves `rig` as `clip` moves, at the clip's frame rate.
///
/// Who follows whom: the rig's map decides, then roles (the rig's own, or recognised from its names; the
/// clip's from its names), for rigs without either equal names. Rig joints nobody plays follow their
/// parents; what is above the hips moves with them.
///
/// Rotations: the two bodies are compared at one instant, the declared pose of the clip if the body
/// stands in it, else the frame closest to that, and from there take the same world rotations. Limbs are
/// first turned to where the clip's point, by the least angle, so that upper and lower arms and legs point
/// where the clip's do in every frame, whatever the rest poses, joint axes, up axes and units are. Of a body
/// narrower than the clip's between its shoulders or its hips, those limbs then swing outward by what their
/// ends lack, five degrees at most: otherwise hands would sink into hips and feet cross. Trunk, neck, head,
/// collar bones and hands that stand on their palms at rest are in the rig at rest when they are in the clip.
/// Feet that are low stand on their soles, toes flat. A shorter spine or neck takes the turn of the longer
/// one's joints together, a longer spine shares it out by arc length.
///
/// Positions: by forward kinematics from the hip joints, which travel in proportion to leg length. The
/// first frame's hips are above their rest position, and the lower foot of the clip's low frames is where
/// the rig's lower foot rests. A rig that is the clip's own skeleton (equal names, declared pose and rest
/// joints equal up to a similarity) moves exactly as the file says instead, stretch and scale included.
///
/// A reference pose put before the motion (frame 0 stands, and jumps) is left out. Warnings, one line each:
/// W_REFERENCE_FRAME_DROPPED, W_REFERENCE_POSE (no frame stands), W_CLIP_UP_AXIS (no up to be found),
/// W_CLIP_SIDES and W_RIG_SIDES (left and right look swapped).
///
/// Throws UnusableInput naming the roles when the clip lacks hips, spine, head or a limb of the rig's, when
/// the map names a joint that is not there, and when nothing matches. Cost: frames x joints.
Motion retarget(const Clip& clip, const RigSkeleton& rig, const RetargetOptions& options = {});

}  // namespace sinew
