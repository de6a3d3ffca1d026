#include "skeleton/bone_turns.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <numeric>

namespace sinew {
namespace {

/// A bone shorter than this share of the body's extent points nowhere worth following: helper joints
/// and joints doubled in place. One centimetre on a grown-up.
constexpr double kShortBone = 0.005;

/// A foot that seems to stand on its sole in the motion, but is tilted by more than this at a standing
/// reference, hangs in the motion: the body sits or lies. In degrees; measured tilts of declared poses
/// stay below 25.
constexpr double kMostSoleTilt = 35.0;

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

double extent(const std::vector<Eigen::Vector3d>& positions) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& position : positions) box.extend(position);
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

bool is_thumb(const std::string& name) {
  std::string lower;
  for (const char c : name) lower += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return lower.find("thumb") != std::string::npos;
}

Eigen::Vector3d mean_of(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return points.empty() ? sum : Eigen::Vector3d(sum / static_cast<double>(points.size()));
}

/// The role at the far end of the bone that a role turns.
std::optional<Role> role_below(Role role) {
  switch (role) {
    case Role::neck:
    case Role::left_shoulder: case Role::left_upper_arm: case Role::left_lower_arm:
    case Role::right_shoulder: case Role::right_upper_arm: case Role::right_lower_arm:
    case Role::left_upper_leg: case Role::left_lower_leg: case Role::left_foot:
    case Role::right_upper_leg: case Role::right_lower_leg: case Role::right_foot:
      return static_cast<Role>(static_cast<int>(role) + 1);
    default: return std::nullopt;
  }
}

/// One bone of both bodies: where it points in the rig at rest, and in the clip.
struct BonePair {
  Eigen::Vector3d rest = Eigen::Vector3d::Zero();  ///< unit; zero when either body has no such bone
  Aim aim;
  bool joins_followers = false;  ///< it ends at a joint that follows the clip too, not at a tip or finger
};

/// One stretch of the clip's spine and the rig joint that follows it.
struct SpineTurn {
  int clip = -1, clip_before = -1;
  double share = 1.0;
  BonePair bone;  ///< its own stretch; nothing where turns are shared out
  bool is_last = false;
};

class Builder {
 public:
  Builder(const Skeleton& clip, std::span<const Pose> frames, const ReferencePose& reference, const RigSkeleton& rig,
          const JointMatch& match, const Alignment& alignment)
      : clip_(clip), frames_(frames), reference_(reference), rig_(rig), match_(match), alignment_(alignment),
        rest_(rest_pose(rig).positions), rig_extent_(extent(rest_)), clip_extent_(extent(reference.pose.positions)),
        at_reference_(rest_.size(), Eigen::Quaterniond::Identity()), spine_(rest_.size()) {
    plan_spine();
  }

  std::vector<BoneTurn> build();

 private:
  bool clip_long(const Aim& aim) const {
    return aim.direction(reference_.pose).norm() > kShortBone * clip_extent_;
  }
  bool rig_long(const Eigen::Vector3d& bone) const { return bone.norm() > kShortBone * rig_extent_; }
  Eigen::Vector3d clip_direction(const Aim& aim) const {
    return alignment_.turn * aim.direction(reference_.pose).normalized();
  }

  BonePair pair_of(const Eigen::Vector3d& rig_bone, Aim aim) const;
  BonePair bone_between(int rig_from, const std::vector<int>& rig_to, int clip_from, std::vector<int> clip_to) const;
  BonePair bone_to_end(int joint) const;
  BonePair bone_of(int joint) const;
  Eigen::Vector3d rig_end(int joint) const;
  Aim clip_end(int joint) const;
  void collect_ends(int joint, Aim& aim) const;
  std::vector<int> followers_below(int joint) const;

  void plan_spine();
  void plan_fewer(const std::vector<int>& rig_chain, const std::vector<int>& clip_chain);
  void plan_more(const std::vector<int>& rig_chain, const std::vector<int>& clip_chain);
  std::vector<int> spine_joints(const BodyJoints& joints) const;
  std::vector<int> spine_top(const BodyJoints& joints) const;
  std::vector<double> ends_along(const std::vector<Eigen::Vector3d>& positions, const BodyJoints& joints,
                                 const std::vector<int>& chain) const;

  Eigen::Quaterniond swung(const Eigen::Quaterniond& from, const BonePair& bone) const;
  Eigen::Quaterniond pelvis() const;
  Eigen::Quaterniond body() const;
  Eigen::Quaterniond foot(int joint, const BonePair& bone) const;
  Eigen::Quaterniond level_head(int joint) const;
  std::vector<int> lowest_frames(int joint, const Eigen::Vector3d& clip_up) const;
  Eigen::Quaterniond chest(const Eigen::Quaterniond& above, const BonePair& bone) const;
  void set_reference(BoneTurn& turn, const Eigen::Quaterniond& above) const;

  const Skeleton& clip_;
  std::span<const Pose> frames_;
  const ReferencePose& reference_;
  const RigSkeleton& rig_;
  const JointMatch& match_;
  const Alignment& alignment_;
  std::vector<Eigen::Vector3d> rest_;
  double rig_extent_, clip_extent_;
  std::vector<Eigen::Quaterniond> at_reference_;  ///< Q per rig joint; followers of a parent inherit it
  std::vector<std::optional<SpineTurn>> spine_;   ///< per rig joint
  BonePair chord_;                                ///< the whole spine, from its first joint to its top
};

BonePair Builder::pair_of(const Eigen::Vector3d& rig_bone, Aim aim) const {
  if (aim.from < 0 || !rig_long(rig_bone) || !clip_long(aim)) return {};
  return {rig_bone.normalized(), std::move(aim), false};
}

BonePair Builder::bone_between(int rig_from, const std::vector<int>& rig_to, int clip_from,
                               std::vector<int> clip_to) const {
  if (rig_to.empty() || clip_to.empty()) return {};
  std::vector<Eigen::Vector3d> ends;
  for (const int joint : rig_to) ends.push_back(rest_[joint]);
  BonePair bone = pair_of(mean_of(ends) - rest_[rig_from], Aim{clip_from, std::move(clip_to), Eigen::Vector3d::Zero()});
  bone.joins_followers = true;
  return bone;
}

/// Rest direction of a bone that no role ends: to its tip, else to what hangs on it except a thumb.
Eigen::Vector3d Builder::rig_end(int joint) const {
  if (rig_.joints[joint].tip) return *rig_.joints[joint].tip - rest_[joint];
  std::vector<Eigen::Vector3d> bones;
  for (int child = joint + 1; child < rig_.joint_count(); ++child)
    if (rig_.joints[child].parent == joint && !is_thumb(rig_.joints[child].name) &&
        rig_long(rest_[child] - rest_[joint]))
      bones.push_back(rest_[child] - rest_[joint]);
  return mean_of(bones);
}

/// Joints one bone away, looking through joints doubled in place.
void Builder::collect_ends(int joint, Aim& aim) const {
  for (int child = joint + 1; child < clip_.joint_count(); ++child) {
    if (clip_.parents[child] != joint || is_thumb(clip_.names[child])) continue;
    if (clip_long(Aim{aim.from, {child}, Eigen::Vector3d::Zero()}))
      aim.to.push_back(child);
    else
      collect_ends(child, aim);
  }
}

Aim Builder::clip_end(int joint) const {
  Aim aim;
  aim.from = joint;
  collect_ends(joint, aim);
  if (aim.to.empty()) aim.offset = mean_of(clip_.tips[joint]);
  return aim;
}

BonePair Builder::bone_to_end(int joint) const {
  return pair_of(rig_end(joint), clip_end(match_.clip_of_rig[joint]));
}

/// The nearest joints below that follow the clip themselves.
std::vector<int> Builder::followers_below(int joint) const {
  std::vector<int> found;
  std::vector<bool> below(rest_.size(), false);
  for (int child = joint + 1; child < rig_.joint_count(); ++child) {
    const int parent = rig_.joints[child].parent;
    if (parent < 0 || (parent != joint && !below[parent])) continue;
    if (match_.clip_of_rig[child] >= 0)
      found.push_back(child);
    else
      below[child] = true;
  }
  return found;
}

BonePair Builder::bone_of(int joint) const {
  if (const std::optional<Role> role = match_.role_of_rig[joint]) {
    const std::optional<Role> below = role_below(*role);
    if (below && match_.pairs(*below))
      return bone_between(joint, {joint_of(match_.rig_body, *below)}, match_.clip_of_rig[joint],
                          {joint_of(match_.clip_body, *below)});
    return bone_to_end(joint);
  }
  const std::vector<int> below = followers_below(joint);
  if (below.empty()) return bone_to_end(joint);
  if (below.size() > 1) return {};
  return bone_between(joint, below, match_.clip_of_rig[joint], {match_.clip_of_rig[below.front()]});
}

std::vector<int> Builder::spine_joints(const BodyJoints& joints) const {
  std::vector<int> chain;
  for (const Role role : {Role::spine, Role::chest, Role::upper_chest})
    if (joint_of(joints, role) >= 0) chain.push_back(joint_of(joints, role));
  return chain;
}

/// Where the spine ends: the neck, the head, or between the shoulders, whichever both bodies have.
std::vector<int> Builder::spine_top(const BodyJoints& joints) const {
  for (const Role role : {Role::neck, Role::head})
    if (match_.pairs(role)) return {joint_of(joints, role)};
  if (match_.pairs(Role::left_upper_arm) && match_.pairs(Role::right_upper_arm))
    return {joint_of(joints, Role::left_upper_arm), joint_of(joints, Role::right_upper_arm)};
  return {};
}

/// How far along the way from hips to top each joint's bone ends, as a share of that way.
std::vector<double> Builder::ends_along(const std::vector<Eigen::Vector3d>& positions, const BodyJoints& joints,
                                        const std::vector<int>& chain) const {
  std::vector<Eigen::Vector3d> top;
  for (const int joint : spine_top(joints)) top.push_back(positions[joint]);
  const int hips = joint_of(joints, Role::hips);
  double length = hips >= 0 ? (positions[chain.front()] - positions[hips]).norm() : 0.0;
  std::vector<double> ends;
  for (std::size_t i = 0; i < chain.size(); ++i) {
    const bool last = i + 1 == chain.size();
    const Eigen::Vector3d end = last ? mean_of(top) : positions[chain[i + 1]];
    length += (end - positions[chain[i]]).norm();
    ends.push_back(length);
  }
  for (double& end : ends) end /= length > 0.0 ? length : 1.0;
  ends.back() = 1.0;
  return ends;
}

void Builder::plan_spine() {
  const std::vector<int> rig_chain = spine_joints(match_.rig_body);
  const std::vector<int> clip_chain = spine_joints(match_.clip_body);
  const bool by_role = !match_.spine_is_named && !rig_chain.empty() && !clip_chain.empty() &&
                       !spine_top(match_.rig_body).empty();
  if (!by_role) return;
  chord_ = bone_between(rig_chain.front(), spine_top(match_.rig_body), clip_chain.front(), spine_top(match_.clip_body));
  if (rig_chain.size() <= clip_chain.size())
    plan_fewer(rig_chain, clip_chain);
  else
    plan_more(rig_chain, clip_chain);
}

/// Each rig joint takes a run of clip joints: its bone follows the whole run, its turn the last of it,
/// since world rotations have gathered those below.
void Builder::plan_fewer(const std::vector<int>& rig_chain, const std::vector<int>& clip_chain) {
  std::vector<std::size_t> first_of_run(rig_chain.size());
  for (std::size_t i = 0; i < rig_chain.size(); ++i) first_of_run[i] = i;
  if (rig_chain.size() == 2 && clip_chain.size() == 3) {
    const double wanted = ends_along(rest_, match_.rig_body, rig_chain)[0];
    const std::vector<double> ends = ends_along(reference_.pose.positions, match_.clip_body, clip_chain);
    first_of_run[1] = std::abs(ends[0] - wanted) <= std::abs(ends[1] - wanted) ? 1 : 2;
  }
  for (std::size_t i = 0; i < rig_chain.size(); ++i) {
    const bool last = i + 1 == rig_chain.size();
    const std::size_t end_of_run = last ? clip_chain.size() : first_of_run[i + 1];
    SpineTurn turn;
    turn.clip = clip_chain[end_of_run - 1];
    turn.is_last = last;
    turn.bone = last ? bone_between(rig_chain[i], spine_top(match_.rig_body), clip_chain[first_of_run[i]],
                                    spine_top(match_.clip_body))
                     : bone_between(rig_chain[i], {rig_chain[i + 1]}, clip_chain[first_of_run[i]],
                                    {clip_chain[end_of_run]});
    spine_[rig_chain[i]] = turn;
  }
}

/// The clip's turns are spread along the rig's spine by arc length, from the hips' to the last one's.
void Builder::plan_more(const std::vector<int>& rig_chain, const std::vector<int>& clip_chain) {
  const std::vector<double> rig_ends = ends_along(rest_, match_.rig_body, rig_chain);
  const std::vector<double> clip_ends = ends_along(reference_.pose.positions, match_.clip_body, clip_chain);
  for (std::size_t i = 0; i < rig_chain.size(); ++i) {
    std::size_t at = 0;
    while (at + 1 < clip_ends.size() && clip_ends[at] < rig_ends[i]) ++at;
    const double begin = at == 0 ? 0.0 : clip_ends[at - 1];
    const double length = clip_ends[at] - begin;
    const int before = at == 0 ? joint_of(match_.clip_body, Role::hips) : clip_chain[at - 1];
    const double share = length > 0.0 ? std::clamp((rig_ends[i] - begin) / length, 0.0, 1.0) : 1.0;
    spine_[rig_chain[i]] = SpineTurn{clip_chain[at], before, share, {}, false};
  }
}

/// `from` turned by the least angle that brings the bone where the clip has it.
Eigen::Quaterniond Builder::swung(const Eigen::Quaterniond& from, const BonePair& bone) const {
  if (bone.rest.isZero()) return from;
  const auto swing = least_turn(from * bone.rest, clip_direction(bone.aim));
  return (swing * from).normalized();
}

/// A standing body keeps its own pelvis tilt and takes the heading of the hip line; otherwise the
/// trunk says how the pelvis is tilted. (The short way from hips to spine depends on where each
/// skeleton's author put those joints, and would tilt it at random.)
Eigen::Quaterniond Builder::pelvis() const {
  const Body rig_body{rest_, match_.rig_body}, clip_body{reference_.pose.positions, match_.clip_body};
  if (!match_.pairs(Role::left_upper_leg) || !match_.pairs(Role::right_upper_leg))
    return Eigen::Quaterniond::Identity();
  const Eigen::Vector3d rig_left = rig_body.at(Role::left_upper_leg) - rig_body.at(Role::right_upper_leg);
  const Eigen::Vector3d clip_left =
      alignment_.turn * (clip_body.at(Role::left_upper_leg) - clip_body.at(Role::right_upper_leg));
  Eigen::Vector3d rig_primary = rig_.up, clip_primary = rig_.up;
  const auto rig_trunk = trunk_of(rig_body), clip_trunk = trunk_of(clip_body);
  if (!reference_.standing && rig_trunk && clip_trunk) {
    rig_primary = *rig_trunk;
    clip_primary = alignment_.turn * *clip_trunk;
  }
  const bool flat = across(rig_left, rig_primary.normalized()).norm() < kShortBone * rig_extent_ ||
                    across(clip_left, clip_primary.normalized()).norm() < kShortBone * clip_extent_;
  if (flat) return Eigen::Quaterniond::Identity();
  return between_axes(axes_of(rig_primary, rig_left), axes_of(clip_primary, clip_left));
}

/// The reference turn of the body as a whole.
Eigen::Quaterniond Builder::body() const {
  const int hips = joint_of(match_.rig_body, Role::hips);
  return hips >= 0 ? at_reference_[hips] : Eigen::Quaterniond::Identity();
}

/// The tenth of frames in which the clip's joint is lowest.
std::vector<int> Builder::lowest_frames(int joint, const Eigen::Vector3d& clip_up) const {
  std::vector<int> order(frames_.size());
  std::iota(order.begin(), order.end(), 0);
  const auto height = [&](int frame) { return frames_[frame].positions[joint].dot(clip_up); };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return height(a) < height(b); });
  order.resize((order.size() + 9) / 10);
  return order;
}

/// A low foot stands on its sole: what is up then, seen from the foot, is up in the rig at rest. Slopes
/// from ankle to toes are no help, since ankles sit at different heights, nor are declared poses, whose
/// feet are tilted by up to 25 degrees. The heading is that of the bone.
Eigen::Quaterniond Builder::foot(int joint, const BonePair& bone) const {
  if (bone.rest.isZero()) return body();
  const int foot = match_.clip_of_rig[joint];
  const Eigen::Vector3d rig_up = rig_.up.normalized();
  const Eigen::Vector3d clip_up = alignment_.turn.conjugate() * rig_up;
  const Eigen::Quaterniond to_foot = reference_.pose.rotations[foot].conjugate();
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const int frame : lowest_frames(foot, clip_up)) up += frames_[frame].rotations[foot].conjugate() * clip_up;
  if (reference_.standing && degrees_between(up, to_foot * clip_up) > kMostSoleTilt) up = to_foot * clip_up;
  const Eigen::Vector3d ahead = to_foot * bone.aim.direction(reference_.pose);
  const bool vertical = degrees_between(bone.rest, -rig_up) < 10.0 || degrees_between(ahead, -up) < 10.0;
  if (up.isZero() || vertical) return body();
  const Eigen::Quaterniond in_foot = between_axes(axes_of(rig_up, bone.rest), axes_of(up, ahead));
  return (alignment_.turn * reference_.pose.rotations[foot] * in_foot).normalized();
}

/// A head is level on the average: what is up and ahead of it then, seen from the head, is so in the rig
/// at rest. (Where files let heads end is no help: some point there, some do not.)
Eigen::Quaterniond Builder::level_head(int joint) const {
  const int head = match_.clip_of_rig[joint];
  const Eigen::Vector3d rig_up = rig_.up.normalized();
  const Eigen::Vector3d clip_up = alignment_.turn.conjugate() * rig_up;
  Eigen::Vector3d up = Eigen::Vector3d::Zero(), left = Eigen::Vector3d::Zero();
  for (const Pose& frame : frames_) {
    const Eigen::Quaterniond to_head = frame.rotations[head].conjugate();
    up += to_head * clip_up;
    left += to_head * left_of({frame.positions, match_.clip_body}, clip_up).value_or(Eigen::Vector3d::Zero());
  }
  const auto rig_left = left_of({rest_, match_.rig_body}, rig_up);
  if (!rig_left || across(left, up.normalized()).norm() < 0.1 * static_cast<double>(frames_.size())) return body();
  const Eigen::Quaterniond in_head = between_axes(axes_of(rig_up, *rig_left), axes_of(up, left));
  return (alignment_.turn * reference_.pose.rotations[head] * in_head).normalized();
}

/// The last spine joint carries the shoulders: its bone's direction exactly, and their line as well as
/// that allows.
Eigen::Quaterniond Builder::chest(const Eigen::Quaterniond& above, const BonePair& bone) const {
  const bool shoulders = match_.pairs(Role::left_upper_arm) && match_.pairs(Role::right_upper_arm);
  if (bone.rest.isZero() || !shoulders) return swung(above, bone);
  const Body rig_body{rest_, match_.rig_body}, clip_body{reference_.pose.positions, match_.clip_body};
  const Eigen::Vector3d rig_left = rig_body.at(Role::left_upper_arm) - rig_body.at(Role::right_upper_arm);
  const Eigen::Vector3d clip_left =
      alignment_.turn * (clip_body.at(Role::left_upper_arm) - clip_body.at(Role::right_upper_arm));
  const Eigen::Vector3d clip_bone = clip_direction(bone.aim);
  if (across(rig_left, bone.rest).norm() < 0.5 * rig_left.norm() ||
      across(clip_left, clip_bone).norm() < 0.5 * clip_left.norm())
    return swung(above, bone);
  return between_axes(axes_of(bone.rest, rig_left), axes_of(clip_bone, clip_left));
}

/// Fills Q, and the aim of bones that follow the clip's direction in every frame.
///
/// Limbs always follow by direction. The trunk does so only for want of a standing reference: joints of
/// spine, neck and collar bones are placed by taste, and to bend a body at rest into the shape of another
/// skeleton's spine would deform it. What stands in both is at rest in both.
void Builder::set_reference(BoneTurn& turn, const Eigen::Quaterniond& above) const {
  const std::optional<Role> role = match_.role_of_rig[turn.rig];
  const auto is = [&](Role one, Role other) { return role == one || role == other; };
  const auto& spine = spine_[turn.rig];
  BonePair bone;
  if (spine && (reference_.standing || spine->bone.rest.isZero())) {
    turn.at_reference = swung(body(), chord_);
  } else if (spine) {
    bone = spine->bone;
    turn.at_reference = spine->is_last ? chest(above, bone) : swung(above, bone);
  } else if (role == Role::hips) {
    turn.at_reference = pelvis();
  } else if (role == Role::head) {
    turn.at_reference = reference_.standing ? body() : level_head(turn.rig);
  } else if (is(Role::left_foot, Role::right_foot)) {
    turn.at_reference = foot(turn.rig, bone_of(turn.rig));
  } else if (is(Role::left_toes, Role::right_toes) || is(Role::left_shoulder, Role::right_shoulder) ||
             (reference_.standing && role == Role::neck)) {
    turn.at_reference = above;
  } else {
    bone = bone_of(turn.rig);
    turn.at_reference = swung(above, bone);
  }
  if (bone.rest.isZero() || !bone.joins_followers) return;
  turn.rest_direction = bone.rest;
  turn.aim = bone.aim;
}

std::vector<BoneTurn> Builder::build() {
  std::vector<BoneTurn> turns;
  for (int joint = 0; joint < rig_.joint_count(); ++joint) {
    const int parent = rig_.joints[joint].parent;
    const Eigen::Quaterniond above = parent >= 0 ? at_reference_[parent] : Eigen::Quaterniond::Identity();
    at_reference_[joint] = above;
    if (match_.clip_of_rig[joint] < 0 && !spine_[joint]) continue;
    BoneTurn turn;
    turn.rig = joint;
    turn.clip = match_.clip_of_rig[joint];
    if (const auto& spine = spine_[joint]) {
      turn.clip = spine->clip;
      turn.clip_before = spine->clip_before;
      turn.share = spine->share;
    }
    set_reference(turn, above);
    at_reference_[joint] = turn.at_reference;
    turns.push_back(turn);
  }
  return turns;
}

}  // namespace

Eigen::Vector3d Aim::direction(const Pose& pose) const {
  if (to.empty()) return pose.rotations[from] * offset;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const int joint : to) mean += pose.positions[joint];
  return mean / static_cast<double>(to.size()) - pose.positions[from];
}

std::vector<BoneTurn> bone_turns(const Skeleton& clip, std::span<const Pose> frames, const ReferencePose& reference,
                                 const RigSkeleton& rig, const JointMatch& match, const Alignment& alignment) {
  return Builder(clip, frames, reference, rig, match, alignment).build();
}

}  // namespace sinew
