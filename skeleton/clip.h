#pragma once

#include <string>
#include <vector>

#include "skeleton/pose.h"

namespace sinew {

/// A skeleton and its sampled motion. Lengths are in the file's own unit: only ratios matter later.
struct Clip {
  std::string name;
  Skeleton skeleton;
  double frames_per_second = 30.0;  ///< > 0
  int frame_count = 0;
  std::vector<Transform> local;       ///< frame * joint_count + joint; parent-relative
  std::vector<std::string> warnings;  ///< repairs the reader made, one line each

  double duration() const { return frame_count > 1 ? (frame_count - 1) / frames_per_second : 0.0; }
  std::span<const Transform> frame(int frame) const {
    const std::size_t joints = skeleton.names.size();
    return {local.data() + frame * joints, joints};
  }
};

/// World pose at `frame`, 0 <= frame < frame_count.
Pose pose_at(const Clip& clip, int frame);

/// The clip sampled at another rate: rotations by shortest-arc slerp, the rest linearly. Frame 0
/// stays at time 0; the last frame is the last one not after the clip's end. Returns the clip
/// unchanged when the rates agree within 1e-9.
Clip resample(const Clip& clip, double frames_per_second);

}  // namespace sinew
