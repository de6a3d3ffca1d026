#include "skeleton/limb_swings.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace sinew {
namespace {

/// No limb swings further: a gesture should stay the same gesture. Five degrees for a straight limb.
const double kMostOutward = std::tan(5.0 * std::numbers::pi / 180.0);

Role after(Role role, int steps) {
  return static_cast<Role>(static_cast<int>(role) + steps);
}

}  // namespace

Eigen::Quaterniond LimbSwing::swing(const Pose& source, const Eigen::Quaterniond& turn,
                                    const Eigen::Quaterniond& upper_turn,
                                    const Eigen::Quaterniond& lower_turn) const {
  const Eigen::Vector3d end = upper_turn * upper_bone + lower_turn * lower_bone;
  const Eigen::Vector3d out = turn * (source.positions[clip_root] - source.positions[clip_opposite]);
  if (end.isZero() || out.isZero()) return Eigen::Quaterniond::Identity();
  // By the direction of the end, not its place: a bent arm would swing by a larger angle the nearer the
  // hand is to the shoulder, and through every angle when it passes there.
  return least_turn(end, end.normalized() + outward * out.normalized());
}

std::vector<LimbSwing> limb_swings(const ReferencePose& reference, const RigSkeleton& rig,
                                   const JointMatch& match, const Alignment& alignment) {
  const std::vector<Eigen::Vector3d> rest = rest_pose(rig).positions;
  const Body rig_body{rest, match.rig_body}, clip_body{reference.pose.positions, match.clip_body};
  std::vector<LimbSwing> swings;
  for (const auto& [left, right] : {std::pair(Role::left_upper_arm, Role::right_upper_arm),
                                    std::pair(Role::left_upper_leg, Role::right_upper_leg)}) {
    if (!match.pairs(left) || !match.pairs(right)) continue;
    const double clip_width = alignment.scale * (clip_body.at(left) - clip_body.at(right)).norm();
    const double lacking = 0.5 * (clip_width - (rig_body.at(left) - rig_body.at(right)).norm());
    if (lacking <= 0.0) continue;
    for (const auto& [root, opposite] : {std::pair(left, right), std::pair(right, left)}) {
      if (!match.pairs(after(root, 1)) || !match.pairs(after(root, 2))) continue;
      LimbSwing limb;
      limb.upper = joint_of(match.rig_body, root);
      limb.lower = joint_of(match.rig_body, after(root, 1));
      limb.upper_bone = rest[limb.lower] - rest[limb.upper];
      limb.lower_bone = rest[joint_of(match.rig_body, after(root, 2))] - rest[limb.lower];
      limb.clip_root = joint_of(match.clip_body, root);
      limb.clip_opposite = joint_of(match.clip_body, opposite);
      limb.outward = std::min(lacking / (limb.upper_bone.norm() + limb.lower_bone.norm()), kMostOutward);
      swings.push_back(limb);
    }
  }
  return swings;
}

}  // namespace sinew
