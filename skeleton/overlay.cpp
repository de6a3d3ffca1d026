#include "skeleton/overlay.h"

#include <algorithm>

#include "skeleton/joint_match.h"
#include "skeleton/similarity.h"

namespace sinew {
namespace {

/// A rig is the clip's own skeleton when a similarity lays one over the other this closely, as a
/// share of its extent: single-precision files pass, a different character does not.
constexpr double kSameSkeleton = 1e-4;

/// How the declared pose of the clip lies over the rig, if it does.
std::optional<Similarity> overlay_of(const Pose& declared, const RigSkeleton& rig,
                                     const std::vector<int>& clip_of_rig) {
  std::vector<Eigen::Vector3d> from;
  for (const int joint : clip_of_rig) from.push_back(declared.positions[joint]);
  const std::vector<Eigen::Vector3d> to = rest_pose(rig).positions;
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& position : to) box.extend(position);
  const double allowed = kSameSkeleton * box.diagonal().norm();
  // Joints in a line fit in many ways: as it lies is the first of them.
  if (misfit({}, from, to) <= allowed) return Similarity{};
  const auto fit = fit_similarity(from, to);
  if (!fit || misfit(*fit, from, to) > allowed) return std::nullopt;
  return fit;
}

/// Every joint where the clip has it, stretch and scale included.
Pose overlaid(const Pose& frame, const Pose& declared, const Similarity& overlay,
              const std::vector<int>& clip_of_rig) {
  Pose pose;
  for (const int joint : clip_of_rig) {
    const Eigen::Quaterniond turn = frame.rotations[joint] * declared.rotations[joint].conjugate();
    pose.positions.push_back(overlay.apply(frame.positions[joint]));
    pose.rotations.push_back((overlay.turn * turn * overlay.turn.conjugate()).normalized());
    pose.scales.push_back(frame.scales[joint] / declared.scales[joint]);
  }
  return pose;
}

/// Keeps the topmost joint that travels at all above its rest position.
void stay_in_place(Motion& motion, const RigSkeleton& rig) {
  const auto travels = [&](std::size_t joint) {
    return std::any_of(motion.poses.begin(), motion.poses.end(), [&](const Pose& pose) {
      return pose.positions[joint] != motion.poses.front().positions[joint];
    });
  };
  std::size_t joint = 0;
  while (joint < rig.joints.size() && !travels(joint)) ++joint;
  if (joint == rig.joints.size()) return;
  for (Pose& pose : motion.poses) {
    const Eigen::Vector3d back =
        across(rig.joints[joint].position - pose.positions[joint], rig.up.normalized());
    for (Eigen::Vector3d& position : pose.positions) position += back;
  }
}

}  // namespace

std::optional<Motion> overlay_motion(const Clip& clip, std::span<const Pose> frames, const RigSkeleton& rig,
                                     const RetargetOptions& options) {
  const std::vector<int> clip_of_rig = match_names(clip.skeleton, rig);
  if (clip_of_rig.empty() || !rig.map.empty()) return std::nullopt;
  const Pose declared = forward_kinematics(clip.skeleton, clip.skeleton.rest);
  const auto overlay = overlay_of(declared, rig, clip_of_rig);
  if (!overlay) return std::nullopt;
  Motion motion;
  for (const Pose& frame : frames) motion.poses.push_back(overlaid(frame, declared, *overlay, clip_of_rig));
  if (options.in_place) stay_in_place(motion, rig);
  return motion;
}

}  // namespace sinew
