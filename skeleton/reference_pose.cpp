#include "skeleton/reference_pose.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sinew {
namespace {

/// Frames asked for the up axis: plenty for a mean, little for a long clip.
constexpr int kUpVotes = 200;

/// The mean of head-seen-from-feet must lie this much along an axis (a cosine) for that axis to be
/// up: bodies that stand at least half of the time pass, bodies on the floor do not.
constexpr double kUpCertain = 0.7;

/// From the feet (or knees) to the head (or neck, chest), unit length.
std::optional<Eigen::Vector3d> upward(const Body& body) {
  std::optional<Eigen::Vector3d> low = body.middle(Role::left_foot, Role::right_foot);
  if (!low) low = body.middle(Role::left_lower_leg, Role::right_lower_leg);
  if (!low) low = body.middle(Role::left_upper_leg, Role::right_upper_leg);
  if (!low) return std::nullopt;
  for (const Role top : {Role::head, Role::neck, Role::upper_chest, Role::chest, Role::spine}) {
    if (!body.has(top)) continue;
    const Eigen::Vector3d direction = body.at(top) - *low;
    if (direction.norm() > 0.0) return direction.normalized();
  }
  return std::nullopt;
}

Eigen::Vector3d mean_upward(std::span<const Pose> frames, const BodyJoints& joints) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const std::size_t stride = std::max<std::size_t>(1, frames.size() / kUpVotes);
  int votes = 0;
  for (std::size_t frame = 0; frame < frames.size(); frame += stride, ++votes)
    sum += upward({frames[frame].positions, joints}).value_or(Eigen::Vector3d::Zero());
  return votes > 0 ? Eigen::Vector3d(sum / votes) : sum;
}

/// The coordinate axis `direction` leans to, with its sign, if it does so by at least `cosine`.
std::optional<Eigen::Vector3d> nearest_axis(const Eigen::Vector3d& direction, double cosine) {
  Eigen::Index largest = 0;
  if (direction.cwiseAbs().maxCoeff(&largest) < cosine) return std::nullopt;
  return Eigen::Vector3d(std::copysign(1.0, direction[largest]) * Eigen::Vector3d::Unit(largest));
}

std::vector<Eigen::Vector3d> bone_directions(const Skeleton& skeleton, const Pose& pose) {
  std::vector<Eigen::Vector3d> directions;
  for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
    const int parent = skeleton.parents[joint];
    if (parent < 0) continue;
    const Eigen::Vector3d bone = pose.positions[joint] - pose.positions[parent];
    if (bone.norm() > 0.0) directions.push_back(bone.normalized());
  }
  return directions;
}

double mean_step(const Pose& from, const Pose& to) {
  double sum = 0.0;
  for (int joint = 0; joint < from.joint_count(); ++joint)
    sum += (to.positions[joint] - from.positions[joint]).norm();
  return sum / from.joint_count();
}

}  // namespace

bool is_degenerate(const Skeleton& skeleton, const Pose& declared, const BodyJoints& joints) {
  const Body body{declared.positions, joints};
  if (body.has(Role::left_foot) && body.has(Role::right_foot)) {
    const double apart = (body.at(Role::left_foot) - body.at(Role::right_foot)).norm();
    if (apart < 0.01 * leg_length(body, true)) return true;
  }
  const std::vector<Eigen::Vector3d> directions = bone_directions(skeleton, declared);
  // A T-pose with fingers has nearly all its bones along one axis, but half of them each way.
  const double cosine = std::cos(10.0 * std::numbers::pi / 180.0);
  for (const double sign : {-1.0, 1.0}) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto along = std::count_if(directions.begin(), directions.end(),
                                       [&](const Eigen::Vector3d& d) { return sign * d[axis] > cosine; });
      if (static_cast<double>(along) > 0.6 * static_cast<double>(directions.size())) return true;
    }
  }
  return directions.empty();
}

Eigen::Vector3d find_up_axis(const Clip& clip, const BodyJoints& joints, std::span<const Pose> frames,
                             std::vector<std::string>& warnings) {
  if (const auto axis = nearest_axis(mean_upward(frames, joints), kUpCertain)) return *axis;
  const Pose declared = forward_kinematics(clip.skeleton, clip.skeleton.rest);
  const auto direction = upward({declared.positions, joints});
  if (direction && !is_degenerate(clip.skeleton, declared, joints))
    if (const auto axis = nearest_axis(*direction, kUpCertain)) return *axis;
  warnings.push_back("W_CLIP_UP_AXIS: the body stands upright along no axis, in no pose; took +y for up");
  return Eigen::Vector3d::UnitY();
}

ReferencePose choose_reference(const Clip& clip, const BodyJoints& joints, std::span<const Pose> frames,
                               const Eigen::Vector3d& up) {
  ReferencePose best{forward_kinematics(clip.skeleton, clip.skeleton.rest), -1, false};
  const bool degenerate = is_degenerate(clip.skeleton, best.pose, joints);
  double least =
      degenerate ? std::numeric_limits<double>::infinity() : stance_fault({best.pose.positions, joints}, up);
  // A declared pose in which the body stands was made to be a reference: no frame is better.
  best.standing = least <= 1.0;
  if (best.standing) return best;
  for (std::size_t frame = 0; frame < frames.size(); ++frame) {
    const double fault = stance_fault({frames[frame].positions, joints}, up);
    if (fault >= least && !(degenerate && frame == 0)) continue;
    least = fault;
    best.frame = static_cast<int>(frame);
  }
  if (best.frame >= 0) best.pose = frames[static_cast<std::size_t>(best.frame)];
  best.standing = least <= 1.0;
  return best;
}

bool has_inserted_first_frame(std::span<const Pose> frames, const BodyJoints& joints,
                              const Eigen::Vector3d& up) {
  constexpr std::size_t kFewestFrames = 5;  // fewer tell nothing about what is usual in this clip
  if (frames.size() < kFewestFrames) return false;
  const Body first{frames[0].positions, joints};
  if (stance_fault(first, up) > 1.0) return false;
  double largest = 0.0;
  for (std::size_t frame = 1; frame + 1 < frames.size(); ++frame)
    largest = std::max(largest, mean_step(frames[frame], frames[frame + 1]));
  const double jump = mean_step(frames[0], frames[1]);
  // Three times the largest later step, and 2 % of a leg so that a body at rest may start to move.
  return jump > 3.0 * largest && jump > 0.02 * leg_length(first, true);
}

}  // namespace sinew
