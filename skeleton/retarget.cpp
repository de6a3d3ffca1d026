#include "skeleton/retarget.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "skeleton/bone_turns.h"
#include "skeleton/limb_swings.h"
#include "skeleton/overlay.h"
#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

/// The floor is where the lower foot is in the lowest frames: this share of them may be lower still
/// (noise, a foot through the floor).
constexpr double kFloorShare = 0.05;

std::vector<Pose> world_poses(const Clip& clip) {
  std::vector<Pose> poses;
  poses.reserve(static_cast<std::size_t>(clip.frame_count));
  for (int frame = 0; frame < clip.frame_count; ++frame) poses.push_back(pose_at(clip, frame));
  return poses;
}

void shift_pose(Pose& pose, const Eigen::Vector3d& by) {
  for (Eigen::Vector3d& position : pose.positions) position += by;
}

/// Turns and moves one rig as one clip does.
class Transfer {
 public:
  Transfer(const ReferencePose& reference, const RigSkeleton& rig, const JointMatch& match,
           const Alignment& alignment, std::vector<BoneTurn> turns, std::vector<LimbSwing> swings)
      : reference_(reference),
        rig_(rig),
        alignment_(alignment),
        up_(rig.up.normalized()),
        rest_(rest_pose(rig).positions),
        turns_(std::move(turns)),
        swings_(std::move(swings)),
        turn_of_rig_(rest_.size(), -1) {
    for (std::size_t turn = 0; turn < turns_.size(); ++turn)
      turn_of_rig_[turns_[turn].rig] = static_cast<int>(turn);
    find_landmarks(match);
  }

  /// The joint that carries the body through space: the hips, or the first that follows the clip.
  int anchor() const { return anchor_; }
  void find_floor(std::span<const Pose> frames);
  Pose pose(const Pose& source) const;

 private:
  struct Landmark {
    int rig, clip;
  };

  void find_landmarks(const JointMatch& match);
  Eigen::Quaterniond turn_since_reference(const Pose& source, int joint) const;
  Eigen::Quaterniond rotation(const BoneTurn& turn, const Pose& source) const;
  std::vector<Eigen::Quaterniond> rotations(const Pose& source) const;
  double lowest_foot(const Pose& source) const;
  Eigen::Vector3d clip_pelvis(const Pose& source) const;
  Eigen::Vector3d rig_pelvis(const Pose& pose) const;

  const ReferencePose& reference_;
  const RigSkeleton& rig_;
  const Alignment& alignment_;
  Eigen::Vector3d up_;
  std::vector<Eigen::Vector3d> rest_;
  std::vector<BoneTurn> turns_;
  std::vector<LimbSwing> swings_;
  std::vector<int> turn_of_rig_;
  int anchor_ = 0;
  std::vector<Landmark> pelvis_;  ///< hip joints, else the anchor
  std::vector<Landmark> feet_;    ///< what the floor is found by
  double floor_shift_ = 0.0;      ///< rig floor minus clip floor, in rig lengths along up
};

void Transfer::find_landmarks(const JointMatch& match) {
  const auto both_sides = [&](Role left, Role right) {
    std::vector<Landmark> pair;
    for (const Role role : {left, right})
      if (match.pairs(role))
        pair.push_back({joint_of(match.rig_body, role), joint_of(match.clip_body, role)});
    return pair.size() == 2 ? pair : std::vector<Landmark>{};
  };
  const int hips = match.pairs(Role::hips) ? joint_of(match.rig_body, Role::hips) : -1;
  anchor_ = hips >= 0 ? hips : turns_.front().rig;
  pelvis_ = both_sides(Role::left_upper_leg, Role::right_upper_leg);
  if (pelvis_.empty()) pelvis_ = {{anchor_, turns_[turn_of_rig_[anchor_]].clip}};
  feet_ = both_sides(Role::left_foot, Role::right_foot);
  if (feet_.empty()) feet_ = both_sides(Role::left_lower_leg, Role::right_lower_leg);
  if (feet_.empty())
    for (const BoneTurn& turn : turns_) feet_.push_back({turn.rig, turn.clip});
}

Eigen::Quaterniond Transfer::turn_since_reference(const Pose& source, int joint) const {
  const Eigen::Quaterniond turn = source.rotations[joint] * reference_.pose.rotations[joint].conjugate();
  return alignment_.turn * turn * alignment_.turn.conjugate();
}

Eigen::Quaterniond Transfer::rotation(const BoneTurn& turn, const Pose& source) const {
  Eigen::Quaterniond change = turn_since_reference(source, turn.clip);
  if (turn.clip_before >= 0)
    change = turn_since_reference(source, turn.clip_before).slerp(turn.share, change);
  const Eigen::Quaterniond rotation = (change * turn.at_reference).normalized();
  if (turn.aim.from < 0) return rotation;
  const Eigen::Vector3d wanted = alignment_.turn * turn.aim.direction(source);
  const Eigen::Vector3d found = rotation * turn.rest_direction;
  // A bone folded back on itself says nothing about the way it went there.
  if (found.dot(wanted) <= -0.99 * wanted.norm()) return rotation;
  return (least_turn(found, wanted) * rotation).normalized();
}

double Transfer::lowest_foot(const Pose& source) const {
  double lowest = std::numeric_limits<double>::infinity();
  for (const Landmark& foot : feet_)
    lowest = std::min(lowest, up_.dot(alignment_.turn * source.positions[foot.clip]));
  return alignment_.scale * lowest;
}

void Transfer::find_floor(std::span<const Pose> frames) {
  std::vector<double> heights;
  for (const Pose& frame : frames) heights.push_back(lowest_foot(frame));
  const auto floor =
      heights.begin() + static_cast<std::ptrdiff_t>(kFloorShare * static_cast<double>(heights.size() - 1));
  std::nth_element(heights.begin(), floor, heights.end());
  double rig_floor = std::numeric_limits<double>::infinity();
  for (const Landmark& foot : feet_) rig_floor = std::min(rig_floor, up_.dot(rest_[foot.rig]));
  floor_shift_ = rig_floor - *floor;
}

Eigen::Vector3d Transfer::clip_pelvis(const Pose& source) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Landmark& landmark : pelvis_) sum += source.positions[landmark.clip];
  return alignment_.scale * (alignment_.turn * (sum / static_cast<double>(pelvis_.size())));
}

Eigen::Vector3d Transfer::rig_pelvis(const Pose& pose) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Landmark& landmark : pelvis_) sum += pose.positions[landmark.rig];
  return sum / static_cast<double>(pelvis_.size());
}

/// Per turn, with limbs swung outward where the rig is narrower. Hands and feet keep the clip's rotation.
std::vector<Eigen::Quaterniond> Transfer::rotations(const Pose& source) const {
  std::vector<Eigen::Quaterniond> rotations;
  for (const BoneTurn& turn : turns_) rotations.push_back(rotation(turn, source));
  for (const LimbSwing& limb : swings_) {
    Eigen::Quaterniond& upper = rotations[turn_of_rig_[limb.upper]];
    Eigen::Quaterniond& lower = rotations[turn_of_rig_[limb.lower]];
    const Eigen::Quaterniond swing = limb.swing(source, alignment_.turn, upper, lower);
    upper = (swing * upper).normalized();
    lower = (swing * lower).normalized();
  }
  return rotations;
}

/// The hip joints, not the hips joint, go where the clip has them: skeletons disagree on where in the
/// pelvis the hips joint is, and legs start at the hip joints.
Pose Transfer::pose(const Pose& source) const {
  Pose pose = rest_pose(rig_);
  const std::vector<Eigen::Quaterniond> turned = rotations(source);
  const Eigen::Quaterniond& carried = turned[turn_of_rig_[anchor_]];
  for (int joint = 0; joint < rig_.joint_count(); ++joint) {
    const int parent = rig_.joints[joint].parent;
    const int turn = turn_of_rig_[joint];
    // What is above the hips, and what hangs beside them, moves with them.
    pose.rotations[joint] = turn >= 0 ? turned[turn] : parent >= 0 ? pose.rotations[parent] : carried;
    const Eigen::Quaterniond& holder = parent >= 0 ? pose.rotations[parent] : carried;
    const Eigen::Vector3d origin = parent >= 0 ? pose.positions[parent] : Eigen::Vector3d::Zero();
    const Eigen::Vector3d rest_origin = parent >= 0 ? rest_[parent] : Eigen::Vector3d::Zero();
    pose.positions[joint] = origin + holder * (rest_[joint] - rest_origin);
  }
  shift_pose(pose, clip_pelvis(source) + floor_shift_ * up_ - rig_pelvis(pose));
  return pose;
}

Motion transfer_motion(const Clip& clip, const RigSkeleton& rig, const JointMatch& match,
                       const std::vector<Pose>& source, const RetargetOptions& options) {
  Motion motion;
  const Eigen::Vector3d clip_up = find_up_axis(clip, match.clip_body, source, motion.warnings);
  const ReferencePose reference = choose_reference(clip, match.clip_body, source, clip_up);
  if (!reference.standing)
    motion.warnings.push_back("W_REFERENCE_POSE: the clip's body stands straight in no frame; " +
                              (reference.frame < 0 ? std::string("took its declared pose")
                                                   : "took frame " + std::to_string(reference.frame)) +
                              " as reference, so limbs may be twisted");
  std::span<const Pose> used = source;
  if (has_inserted_first_frame(source, match.clip_body, clip_up)) {
    used = used.subspan(1);
    motion.warnings.push_back(
        "W_REFERENCE_FRAME_DROPPED: frame 0 is a reference pose put before the motion; left out");
  }
  const Alignment alignment = align_bodies(reference, clip_up, rig, match, motion.warnings);
  Transfer transfer(
      reference, rig, match, alignment, bone_turns(clip.skeleton, source, reference, rig, match, alignment),
      options.limb_swings ? limb_swings(reference, rig, match, alignment) : std::vector<LimbSwing>{});
  transfer.find_floor(used);
  const Eigen::Vector3d up = rig.up.normalized();
  const Eigen::Vector3d start = rig.joints[transfer.anchor()].position;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  for (const Pose& frame : used) {
    motion.poses.push_back(transfer.pose(frame));
    if (motion.poses.size() == 1 || options.in_place)
      shift = across(start - motion.poses.back().positions[transfer.anchor()], up);
    shift_pose(motion.poses.back(), shift);
  }
  return motion;
}

}  // namespace

Motion retarget(const Clip& clip, const RigSkeleton& rig, const RetargetOptions& options) {
  check_skeleton(clip.skeleton, "retarget");
  check_rig_skeleton(rig, "retarget");
  if (clip.frame_count < 1) throw UnusableInput("the clip '" + clip.name + "' has no frames");
  if (rig.joints.empty()) throw UnusableInput("the rig has no joints");
  const std::vector<Pose> source = world_poses(clip);
  std::optional<Motion> own = overlay_motion(clip, source, rig, options);
  Motion motion =
      own ? std::move(*own) : transfer_motion(clip, rig, match_joints(clip.skeleton, rig), source, options);
  motion.name = clip.name;
  motion.frames_per_second = clip.frames_per_second;
  make_continuous(motion.poses, rig.parents());
  return motion;
}

}  // namespace sinew
