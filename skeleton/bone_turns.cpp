#include "skeleton/bone_turns.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <numeric>

#include "skeleton/spine_turns.h"

namespace sinew {
namespace {

/// A bone shorter than this share of the body's extent points nowhere worth following: helper joints
/// and joints doubled in place. One centimetre on a grown-up.
constexpr double kShortBone = 0.005;

/// A foot that seems to stand on its sole in the motion, but is tilted by more than this at a standing
/// reference, hangs in the motion: the body sits or lies. In degrees; measured tilts of declared poses
/// stay below 25.
constexpr double kMostSoleTilt = 35.0;

/// A hand that at rest points this far away from its forearm, in degrees, is a paw that stands on its palm.
constexpr double kPaw = 45.0;

/// Share of a foot's length along the floor below which it shows no heading: 60 degrees down.
constexpr double kLevelPart = 0.5;

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
    case Role::left_shoulder:
    case Role::left_upper_arm:
    case Role::left_lower_arm:
    case Role::right_shoulder:
    case Role::right_upper_arm:
    case Role::right_lower_arm:
    case Role::left_upper_leg:
    case Role::left_lower_leg:
    case Role::left_foot:
    case Role::right_upper_leg:
    case Role::right_lower_leg:
    case Role::right_foot:
      return static_cast<Role>(static_cast<int>(role) + 1);
    default:
      return std::nullopt;
  }
}

/// One bone of both bodies: where it points in the rig at rest, and in the clip.
struct BonePair {
  Eigen::Vector3d rest = Eigen::Vector3d::Zero();  ///< unit; zero when either body has no such bone
  Aim aim;
  bool joins_followers = false;  ///< it ends at a joint that follows the clip too, not at a tip or finger
};

class Builder {
 public:
  Builder(const Skeleton& clip, std::span<const Pose> frames, const ReferencePose& reference,
          const RigSkeleton& rig, const JointMatch& match, const Alignment& alignment)
      : clip_(clip),
        frames_(frames),
        reference_(reference),
        rig_(rig),
        match_(match),
        alignment_(alignment),
        rest_(rest_pose(rig).positions),
        rig_extent_(extent(rest_)),
        clip_extent_(extent(reference.pose.positions)),
        at_reference_(rest_.size(), Eigen::Quaterniond::Identity()),
        spine_(spine_turns(rest_, reference.pose.positions, match)) {}

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
  BonePair bone_between(int rig_from, int rig_to, int clip_from, int clip_to) const;
  BonePair bone_to_end(int joint) const;
  BonePair bone_of(int joint) const;
  Eigen::Vector3d rig_end(int joint) const;
  Aim clip_end(int joint) const;
  void collect_ends(int joint, Aim& aim) const;
  std::vector<int> followers_below(int joint) const;
  int end_of_neck(int joint) const;

  bool is_paw(int joint) const;

  Eigen::Quaterniond swung(const Eigen::Quaterniond& from, const BonePair& bone) const;
  Eigen::Quaterniond pelvis() const;
  Eigen::Quaterniond upright_turn(Role left, Role right, const Eigen::Vector3d& axis) const;
  Eigen::Quaterniond body() const;
  Eigen::Quaterniond foot(int joint, const BonePair& bone) const;
  Eigen::Quaterniond toes(int joint, const Eigen::Quaterniond& above) const;
  Eigen::Vector3d up_when_low(int joint, int foot) const;
  Eigen::Quaterniond level_head(int joint) const;
  std::vector<int> lowest_frames(int joint, const Eigen::Vector3d& clip_up) const;
  Eigen::Quaterniond spine(const SpineTurn& turn) const;
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
};

BonePair Builder::pair_of(const Eigen::Vector3d& rig_bone, Aim aim) const {
  if (aim.from < 0 || !rig_long(rig_bone) || !clip_long(aim)) return {};
  return {rig_bone.normalized(), std::move(aim), false};
}

BonePair Builder::bone_between(int rig_from, int rig_to, int clip_from, int clip_to) const {
  BonePair bone =
      pair_of(rest_[rig_to] - rest_[rig_from], Aim{clip_from, {clip_to}, Eigen::Vector3d::Zero()});
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

/// The clip's joint whose turn a rig joint takes. Necks of two joints in a clip often bend back in the first
/// and forth in the second by as much: a neck takes what its joints turn together, unless the rig's map names
/// another.
int Builder::end_of_neck(int joint) const {
  const int neck = match_.clip_of_rig[joint];
  if (match_.role_of_rig[joint] != Role::neck || !match_.pairs(Role::head)) return neck;
  const std::string& name = rig_.joints[joint].name;
  if (std::any_of(rig_.map.begin(), rig_.map.end(), [&](const auto& pair) { return pair.first == name; }))
    return neck;
  const int end = clip_.parents[joint_of(match_.clip_body, Role::head)];
  for (int above = end; above >= 0; above = clip_.parents[above])
    if (above == neck) return end;
  return neck;
}

BonePair Builder::bone_of(int joint) const {
  if (const std::optional<Role> role = match_.role_of_rig[joint]) {
    const std::optional<Role> below = role_below(*role);
    if (below && match_.pairs(*below))
      return bone_between(joint, joint_of(match_.rig_body, *below), match_.clip_of_rig[joint],
                          joint_of(match_.clip_body, *below));
    return bone_to_end(joint);
  }
  const std::vector<int> below = followers_below(joint);
  if (below.empty()) return bone_to_end(joint);
  if (below.size() > 1) return {};
  return bone_between(joint, below.front(), match_.clip_of_rig[joint], match_.clip_of_rig[below.front()]);
}

/// Hands of clips are in line with their forearms; to point a paw there would stand it on its toes.
bool Builder::is_paw(int joint) const {
  const std::optional<Role> role = match_.role_of_rig[joint];
  if (role != Role::left_hand && role != Role::right_hand) return false;
  const int forearm = joint_of(match_.rig_body, static_cast<Role>(static_cast<int>(*role) - 1));
  const Eigen::Vector3d hand = rig_end(joint);
  return forearm >= 0 && rig_long(hand) && degrees_between(hand, rest_[joint] - rest_[forearm]) > kPaw;
}

/// `from` turned by the least angle that brings the bone where the clip has it.
Eigen::Quaterniond Builder::swung(const Eigen::Quaterniond& from, const BonePair& bone) const {
  if (bone.rest.isZero()) return from;
  const auto swing = least_turn(from * bone.rest, clip_direction(bone.aim));
  return (swing * from).normalized();
}

/// A standing body keeps its pelvis as at rest and takes the heading of the hip line; otherwise the trunk
/// says how the pelvis is tilted. (The short way from hips to spine depends on where each skeleton's
/// author put those joints, and would tilt it at random.)
Eigen::Quaterniond Builder::pelvis() const {
  const auto trunk = trunk_of({reference_.pose.positions, match_.clip_body});
  return upright_turn(Role::left_upper_leg, Role::right_upper_leg,
                      reference_.standing || !trunk ? rig_.up : Eigen::Vector3d(alignment_.turn * *trunk));
}

/// The turn that takes the rig's up to `axis`, and the line between two of its joints to the clip's.
Eigen::Quaterniond Builder::upright_turn(Role left, Role right, const Eigen::Vector3d& axis) const {
  if (!match_.pairs(left) || !match_.pairs(right)) return Eigen::Quaterniond::Identity();
  const Body rig_body{rest_, match_.rig_body}, clip_body{reference_.pose.positions, match_.clip_body};
  const Eigen::Vector3d rig_left = rig_body.at(left) - rig_body.at(right);
  const Eigen::Vector3d clip_left = alignment_.turn * (clip_body.at(left) - clip_body.at(right));
  const bool along = across(rig_left, rig_.up.normalized()).norm() < 0.5 * rig_left.norm() ||
                     across(clip_left, axis.normalized()).norm() < 0.5 * clip_left.norm();
  if (along || rig_left.isZero() || clip_left.isZero()) return Eigen::Quaterniond::Identity();
  return between_axes(axes_of(rig_.up, rig_left), axes_of(axis, clip_left));
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

/// What is up, seen from the clip's joint, when the clip's foot is low. Not normalised.
Eigen::Vector3d Builder::up_when_low(int joint, int foot) const {
  const Eigen::Vector3d clip_up = alignment_.turn.conjugate() * rig_.up.normalized();
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const int frame : lowest_frames(foot, clip_up))
    up += frames_[frame].rotations[joint].conjugate() * clip_up;
  return up;
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
  Eigen::Vector3d up = up_when_low(foot, foot);
  if (reference_.standing && degrees_between(up, to_foot * clip_up) > kMostSoleTilt) up = to_foot * clip_up;
  // A foot that points down shows no heading; then it is the body's.
  const Eigen::Vector3d ahead = clip_direction(bone.aim);
  const bool steep =
      across(bone.rest, rig_up).norm() < kLevelPart || across(ahead, rig_up).norm() < kLevelPart;
  const Eigen::Vector3d rig_ahead = steep ? rig_.front : bone.rest;
  const Eigen::Vector3d clip_ahead = to_foot * (alignment_.turn.conjugate() * (steep ? rig_.front : ahead));
  if (across(clip_ahead, up.normalized()).norm() < kShortBone) return body();
  const Eigen::Quaterniond in_foot = between_axes(axes_of(rig_up, rig_ahead), axes_of(up, clip_ahead));
  return (alignment_.turn * reference_.pose.rotations[foot] * in_foot).normalized();
}

/// The toes of a low foot lie flat, as those of the rig do at rest. (Between foot and toes declared poses and
/// trackers put up to 25 degrees that no standing foot has.)
Eigen::Quaterniond Builder::toes(int joint, const Eigen::Quaterniond& above) const {
  const Role foot_role = static_cast<Role>(static_cast<int>(*match_.role_of_rig[joint]) - 1);
  if (!match_.pairs(foot_role)) return above;
  const int toes = match_.clip_of_rig[joint];
  const Eigen::Vector3d low_up = up_when_low(toes, joint_of(match_.clip_body, foot_role));
  const Eigen::Vector3d flat = alignment_.turn * (reference_.pose.rotations[toes] * low_up);
  const Eigen::Vector3d carried = above * rig_.up.normalized();
  if (flat.isZero() || degrees_between(carried, flat) > kMostSoleTilt) return above;
  return (least_turn(carried, flat) * above).normalized();
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
  if (!rig_left || across(left, up.normalized()).norm() < 0.1 * static_cast<double>(frames_.size()))
    return body();
  const Eigen::Quaterniond in_head = between_axes(axes_of(rig_up, *rig_left), axes_of(up, left));
  return (alignment_.turn * reference_.pose.rotations[head] * in_head).normalized();
}

/// The reference turn of a spine joint. A body that does not stand may be bent and twisted: its spine
/// joints share the turn from the pelvis to the shoulders.
Eigen::Quaterniond Builder::spine(const SpineTurn& turn) const {
  const auto trunk = trunk_of({reference_.pose.positions, match_.clip_body});
  if (reference_.standing || !trunk) return body();
  const Eigen::Quaterniond top =
      upright_turn(Role::left_upper_arm, Role::right_upper_arm, alignment_.turn * *trunk);
  return body().slerp(turn.along, top);
}

/// Fills Q, and the aim of bones that follow the clip's direction in every frame.
///
/// Limbs follow by direction. The trunk, neck, collar bones and paws do not: to bend a body at rest into the
/// shape of another skeleton's spine would deform it. What is at rest in one is at rest in the other.
void Builder::set_reference(BoneTurn& turn, const Eigen::Quaterniond& above) const {
  const std::optional<Role> role = match_.role_of_rig[turn.rig];
  const auto is = [&](std::initializer_list<Role> roles) {
    return role && std::find(roles.begin(), roles.end(), *role) != roles.end();
  };
  turn.at_reference = above;
  if (spine_[turn.rig]) {
    turn.at_reference = spine(*spine_[turn.rig]);
  } else if (is({Role::spine, Role::chest, Role::upper_chest})) {
    turn.at_reference = body();
  } else if (is({Role::hips})) {
    turn.at_reference = pelvis();
  } else if (is({Role::head})) {
    turn.at_reference = reference_.standing ? body() : level_head(turn.rig);
  } else if (is({Role::left_foot, Role::right_foot})) {
    turn.at_reference = foot(turn.rig, bone_of(turn.rig));
  } else if (is({Role::left_toes, Role::right_toes})) {
    turn.at_reference = toes(turn.rig, above);
  } else if (!is({Role::neck, Role::left_shoulder, Role::right_shoulder}) && !is_paw(turn.rig)) {
    const BonePair bone = bone_of(turn.rig);
    turn.at_reference = swung(above, bone);
    if (bone.rest.isZero() || !bone.joins_followers) return;
    turn.rest_direction = bone.rest;
    turn.aim = bone.aim;
  }
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
    turn.clip = end_of_neck(joint);
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

std::vector<BoneTurn> bone_turns(const Skeleton& clip, std::span<const Pose> frames,
                                 const ReferencePose& reference, const RigSkeleton& rig,
                                 const JointMatch& match, const Alignment& alignment) {
  return Builder(clip, frames, reference, rig, match, alignment).build();
}

}  // namespace sinew
