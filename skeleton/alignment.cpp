#include "skeleton/alignment.h"

#include "skeleton/similarity.h"

namespace sinew {
namespace {

/// Roles that only one of the bodies has would make the other's measures different ones.
BodyJoints shared_joints(const BodyJoints& joints, const JointMatch& match) {
  BodyJoints shared = joints;
  for (int role = 0; role < kRoleCount; ++role)
    if (!match.pairs(static_cast<Role>(role))) shared[role] = -1;
  return shared;
}

Alignment align_by_joints(const std::vector<Eigen::Vector3d>& rest, const Pose& pose,
                          const std::vector<int>& clip_of_rig) {
  std::vector<Eigen::Vector3d> from, to;
  for (std::size_t joint = 0; joint < rest.size(); ++joint) {
    if (clip_of_rig[joint] < 0) continue;
    from.push_back(pose.positions[clip_of_rig[joint]]);
    to.push_back(rest[joint]);
  }
  const Similarity fit = fit_similarity(from, to).value_or(Similarity{});
  return {fit.turn, fit.scale};
}

/// Mean direction of the feet along the floor; zero when there are no toes to see it by.
Eigen::Vector3d feet_direction(const Body& body, const Eigen::Vector3d& up) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Role foot : {Role::left_foot, Role::right_foot}) {
    const Role toes = static_cast<Role>(static_cast<int>(foot) + 1);
    if (body.has(foot) && body.has(toes)) sum += across(body.at(toes) - body.at(foot), up);
  }
  return sum;
}

void warn_of_sides(const Body& clip_body, const Eigen::Vector3d& clip_up, const Eigen::Vector3d& clip_left,
                   const RigSkeleton& rig, const Eigen::Vector3d& rig_front,
                   std::vector<std::string>& warnings) {
  if (rig_front.dot(rig.front.normalized()) < 0.0)
    warnings.push_back(
        "W_RIG_SIDES: by its left and right joints the rig looks away from its front; "
        "check [rig] front and the roles' sides");
  const Eigen::Vector3d toes = feet_direction(clip_body, clip_up);
  if (toes.norm() > 0.0 && toes.normalized().dot(clip_left.cross(clip_up)) < -0.5)
    warnings.push_back(
        "W_CLIP_SIDES: by its left and right joints the clip's body looks away from its "
        "toes; its sides may be swapped");
}

}  // namespace

Alignment align_bodies(const ReferencePose& reference, const Eigen::Vector3d& clip_up, const RigSkeleton& rig,
                       const JointMatch& match, std::vector<std::string>& warnings) {
  const std::vector<Eigen::Vector3d> rest = rest_pose(rig).positions;
  const BodyJoints rig_joints = shared_joints(match.rig_body, match);
  const BodyJoints clip_joints = shared_joints(match.clip_body, match);
  const Body rig_body{rest, rig_joints}, clip_body{reference.pose.positions, clip_joints};
  const Eigen::Vector3d rig_up = rig.up.normalized();
  const auto rig_left = left_of(rig_body, rig_up);
  const auto clip_left = left_of(clip_body, clip_up);
  const bool with_feet = leg_length(rig_body, true) > 0.0;
  const double rig_leg = leg_length(rig_body, with_feet), clip_leg = leg_length(clip_body, with_feet);
  if (!rig_left || !clip_left || rig_leg <= 0.0 || clip_leg <= 0.0)
    return align_by_joints(rest, reference.pose, match.clip_of_rig);
  warn_of_sides(clip_body, clip_up, *clip_left, rig, rig_left->cross(rig_up), warnings);
  return {between_axes(axes_of(clip_up, *clip_left), axes_of(rig_up, *rig_left)), rig_leg / clip_leg};
}

Eigen::Matrix3d axes_of(const Eigen::Vector3d& primary, const Eigen::Vector3d& left) {
  Eigen::Matrix3d axes;
  axes.col(1) = primary.normalized();
  axes.col(0) = across(left, axes.col(1)).normalized();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

Eigen::Quaterniond between_axes(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to) {
  return Eigen::Quaterniond(Eigen::Matrix3d(to * from.transpose())).normalized();
}

Eigen::Quaterniond least_turn(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d a = from.normalized(), b = to.normalized();
  const Eigen::Vector3d sum = a + b;
  // Rotating by half the angle twice is rotating from a to the bisector and on: w = a.h, v = a x h.
  if (sum.norm() < 1e-9) {
    const Eigen::Vector3d axis = a.unitOrthogonal();
    return {0.0, axis.x(), axis.y(), axis.z()};
  }
  const Eigen::Vector3d half = sum.normalized();
  const Eigen::Vector3d axis = a.cross(half);
  return Eigen::Quaterniond(a.dot(half), axis.x(), axis.y(), axis.z()).normalized();
}

}  // namespace sinew
