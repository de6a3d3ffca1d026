#include "skeleton/clip.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace sinew {
namespace {

/// Two instants closer than this are one. In frames: far above what rounding leaves after a million
/// frames, far below any motion.
constexpr double kSameInstant = 1e-6;

Transform between(const Transform& from, const Transform& to, double share) {
  return {.translation = from.translation + share * (to.translation - from.translation),
          .rotation = from.rotation.slerp(share, to.rotation).normalized(),
          .scale = from.scale + share * (to.scale - from.scale)};
}

/// The local transforms at `instant` (in frames of the clip), appended to `out`.
void append_sample(const Clip& clip, double instant, std::vector<Transform>& out) {
  const double nearest = std::round(instant);
  const bool on_frame = std::abs(instant - nearest) < kSameInstant;
  const int frame = std::clamp(static_cast<int>(on_frame ? nearest : std::floor(instant)), 0, clip.frame_count - 1);
  const std::span<const Transform> from = clip.frame(frame);
  if (on_frame || frame + 1 == clip.frame_count) {
    out.insert(out.end(), from.begin(), from.end());
    return;
  }
  const std::span<const Transform> to = clip.frame(frame + 1);
  for (std::size_t joint = 0; joint < from.size(); ++joint) {
    out.push_back(between(from[joint], to[joint], instant - frame));
  }
}

}  // namespace

Pose pose_at(const Clip& clip, int frame) {
  if (frame < 0 || frame >= clip.frame_count) {
    throw std::invalid_argument("pose_at: frame " + std::to_string(frame) + " of a clip with " +
                                std::to_string(clip.frame_count) + " frames");
  }
  return forward_kinematics(clip.skeleton, clip.frame(frame));
}

Clip resample(const Clip& clip, double frames_per_second) {
  if (!std::isfinite(frames_per_second) || frames_per_second <= 0.0) {
    throw std::invalid_argument("resample: " + std::to_string(frames_per_second) +
                                " frames per second; expected a positive number");
  }
  if (std::abs(frames_per_second - clip.frames_per_second) <= 1e-9 || clip.frame_count == 0) return clip;
  const double step = clip.frames_per_second / frames_per_second;  // source frames per new frame
  const double last = std::floor((clip.frame_count - 1) / step + kSameInstant);
  if (last >= std::numeric_limits<int>::max()) {
    throw std::invalid_argument("resample: " + std::to_string(frames_per_second) +
                                " frames per second make more frames than can be counted");
  }
  Clip result{.name = clip.name, .skeleton = clip.skeleton, .frames_per_second = frames_per_second,
              .frame_count = static_cast<int>(last) + 1, .local = {}, .warnings = clip.warnings};
  result.local.reserve(clip.skeleton.names.size() * static_cast<std::size_t>(result.frame_count));
  for (int frame = 0; frame < result.frame_count; ++frame) append_sample(clip, frame * step, result.local);
  return result;
}

}  // namespace sinew
