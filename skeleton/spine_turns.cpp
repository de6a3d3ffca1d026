#include "skeleton/spine_turns.h"

#include <algorithm>
#include <cmath>

namespace sinew {
namespace {

/// The spine of one body: its joints from the hips up, and how far along the way from hips to top the bone
/// of each ends, as a share of that way.
struct Spine {
  std::vector<int> joints;
  std::vector<double> ends;
};

/// Where the spine ends: at the neck, the head, or between the shoulders, whichever both bodies have.
std::optional<Eigen::Vector3d> spine_top(const Body& body, const JointMatch& match) {
  for (const Role role : {Role::neck, Role::head})
    if (match.pairs(role)) return body.at(role);
  if (!match.pairs(Role::left_upper_arm) || !match.pairs(Role::right_upper_arm)) return std::nullopt;
  return body.middle(Role::left_upper_arm, Role::right_upper_arm);
}

Spine spine_of(const Body& body, const JointMatch& match) {
  Spine spine;
  const auto top = spine_top(body, match);
  for (const Role role : {Role::spine, Role::chest, Role::upper_chest})
    if (top && body.has(role)) spine.joints.push_back(joint_of(body.joints, role));
  if (spine.joints.empty()) return spine;
  const Eigen::Vector3d& first = body.positions[spine.joints.front()];
  double length = body.has(Role::hips) ? (first - body.at(Role::hips)).norm() : 0.0;
  for (std::size_t i = 0; i < spine.joints.size(); ++i) {
    const bool last = i + 1 == spine.joints.size();
    const Eigen::Vector3d end = last ? *top : body.positions[spine.joints[i + 1]];
    length += (end - body.positions[spine.joints[i]]).norm();
    spine.ends.push_back(length);
  }
  for (double& end : spine.ends) end /= length > 0.0 ? length : 1.0;
  spine.ends.back() = 1.0;
  return spine;
}

/// Each rig joint gets the clip joint whose bone ends nearest to its own, in order, the last the last.
std::vector<SpineTurn> take_runs(const Spine& rig, const Spine& clip) {
  std::vector<SpineTurn> turns;
  std::size_t at = 0;
  for (std::size_t i = 0; i < rig.joints.size(); ++i) {
    const auto distance = [&](std::size_t joint) { return std::abs(clip.ends[joint] - rig.ends[i]); };
    // One clip joint is left for each rig joint still to come.
    const std::size_t most = clip.joints.size() - (rig.joints.size() - i);
    while (at < most && distance(at + 1) <= distance(at)) ++at;
    turns.push_back({clip.joints[at], -1, 1.0, rig.ends[i]});
    ++at;
  }
  return turns;
}

/// The clip's turns, known at the ends of its bones and at the hips, read off at the ends of the rig's.
std::vector<SpineTurn> share_out(const Spine& rig, const Spine& clip, int clip_hips) {
  std::vector<SpineTurn> turns;
  for (const double end : rig.ends) {
    std::size_t at = 0;
    while (at + 1 < clip.ends.size() && clip.ends[at] < end) ++at;
    const double begin = at == 0 ? 0.0 : clip.ends[at - 1];
    const double length = clip.ends[at] - begin;
    const double share = length > 0.0 ? std::clamp((end - begin) / length, 0.0, 1.0) : 1.0;
    turns.push_back({clip.joints[at], at == 0 ? clip_hips : clip.joints[at - 1], share, end});
  }
  return turns;
}

}  // namespace

std::vector<std::optional<SpineTurn>> spine_turns(std::span<const Eigen::Vector3d> rest,
                                                  std::span<const Eigen::Vector3d> reference,
                                                  const JointMatch& match) {
  std::vector<std::optional<SpineTurn>> turn_of_joint(rest.size());
  const Spine rig = spine_of({rest, match.rig_body}, match);
  const Spine clip = spine_of({reference, match.clip_body}, match);
  if (rig.joints.empty() || clip.joints.empty() || match.spine_is_named) return turn_of_joint;
  const std::vector<SpineTurn> turns = rig.joints.size() <= clip.joints.size()
                                           ? take_runs(rig, clip)
                                           : share_out(rig, clip, joint_of(match.clip_body, Role::hips));
  for (std::size_t i = 0; i < turns.size(); ++i) turn_of_joint[rig.joints[i]] = turns[i];
  return turn_of_joint;
}

}  // namespace sinew
