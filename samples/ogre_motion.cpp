#include "samples/ogre_motion.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <string>

namespace sinew::samples {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

constexpr double kFramesPerSecond = 30.0;

struct JointPlan {
  const char* name;
  const char* clip_name;
  const char* parent;
  Vector3d position;
};

/// The left side and the middle; the right side is the mirror image.
const std::vector<JointPlan>& plan() {
  static const std::vector<JointPlan> joints = {
      {"hips", "Hips", "", {0.0, 0.97, 0.0}},
      {"spine", "Spine", "hips", {0.0, 1.09, 0.02}},
      {"chest", "Spine1", "spine", {0.0, 1.24, 0.02}},
      {"upper_chest", "Spine2", "chest", {0.0, 1.38, -0.005}},
      {"neck", "Neck", "upper_chest", {0.0, 1.555, 0.0}},
      {"head", "Head", "neck", {0.0, 1.65, 0.03}},
      {"left_shoulder", "LeftShoulder", "upper_chest", {0.085, 1.485, -0.01}},
      {"left_upper_arm", "LeftArm", "left_shoulder", {0.235, 1.495, -0.01}},
      {"left_lower_arm", "LeftForeArm", "left_upper_arm", {0.52, 1.44, -0.015}},
      {"left_hand", "LeftHand", "left_lower_arm", {0.80, 1.385, 0.0}},
      {"left_upper_leg", "LeftUpLeg", "hips", {0.122, 0.90, 0.0}},
      {"left_lower_leg", "LeftLeg", "left_upper_leg", {0.150, 0.51, 0.008}},
      {"left_foot", "LeftFoot", "left_lower_leg", {0.158, 0.105, -0.02}},
      {"left_toes", "LeftToeBase", "left_foot", {0.180, 0.038, 0.115}},
  };
  return joints;
}

const Vector3d kCrown(0.0, 1.885, 0.045);
const Vector3d kFingerTip(1.025, 1.339, 0.008);
const Vector3d kToeTip(0.186, 0.036, 0.205);
const Vector3d kHeel(0.155, 0.0, -0.11);
const Vector3d kBall(0.180, 0.0, 0.13);

Vector3d mirror(const Vector3d& p) { return {-p.x(), p.y(), p.z()}; }

std::string other_side(std::string name) {
  for (const auto& [left, right] : {std::pair{"left", "right"}, {"Left", "Right"}}) {
    if (const auto at = name.find(left); at == 0) return name.replace(at, std::string(left).size(), right);
  }
  return name;
}

bool is_left(const std::string& name) { return name.rfind("left", 0) == 0; }

/// Everything twice: the left joints as planned, then their mirror images, parents before children.
std::vector<JointPlan> both_sides(std::vector<std::string>& storage) {
  std::vector<JointPlan> joints = plan();
  storage.reserve(3 * joints.size());
  for (const JointPlan& joint : plan()) {
    if (!is_left(joint.name)) continue;
    storage.push_back(other_side(joint.name));
    const char* name = storage.back().c_str();
    storage.push_back(other_side(joint.clip_name));
    const char* clip_name = storage.back().c_str();
    storage.push_back(other_side(joint.parent));
    joints.push_back({name, clip_name, storage.back().c_str(), mirror(joint.position)});
  }
  return joints;
}

Quaterniond turn(double degrees, const Vector3d& axis) {
  return Quaterniond(Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, axis));
}
Quaterniond about_x(double degrees) { return turn(degrees, Vector3d::UnitX()); }
Quaterniond about_y(double degrees) { return turn(degrees, Vector3d::UnitY()); }
Quaterniond about_z(double degrees) { return turn(degrees, Vector3d::UnitZ()); }

struct Key {
  double phase;  ///< 0 to 1
  double value;
};

/// Periodic Catmull-Rom curve through keys in rising phase.
double periodic(const std::vector<Key>& keys, double phase) {
  const int count = static_cast<int>(keys.size());
  phase -= std::floor(phase);
  int last = count - 1;
  for (int i = 0; i < count; ++i) {
    if (keys[i].phase <= phase) last = i;
  }
  if (phase < keys.front().phase) last = count - 1;
  const auto key = [&](int i) {
    const int wrapped = ((i % count) + count) % count;
    return Key{keys[wrapped].phase + (i - wrapped) / count, keys[wrapped].value};
  };
  if (phase < keys.front().phase) phase += 1.0;
  const Key k0 = key(last - 1), k1 = key(last), k2 = key(last + 1), k3 = key(last + 2);
  const double span = k2.phase - k1.phase;
  const double t = (phase - k1.phase) / span;
  const double m1 = (k2.value - k0.value) / (k2.phase - k0.phase) * span;
  const double m2 = (k3.value - k1.value) / (k3.phase - k1.phase) * span;
  const double t2 = t * t, t3 = t2 * t;
  return (2 * t3 - 3 * t2 + 1) * k1.value + (t3 - 2 * t2 + t) * m1 + (-2 * t3 + 3 * t2) * k2.value + (t3 - t2) * m2;
}

// One stride of one leg, degrees against phase; phase 0 is the heel's landing. Curves in the manner of
// clinical gait charts, the knee bent a little more as heavy walkers do.
const std::vector<Key> kThighForward = {{0.0, 27}, {0.15, 20}, {0.3, 4}, {0.5, -15}, {0.6, -9}, {0.75, 19}, {0.88, 31}};
const std::vector<Key> kKneeBend = {{0.0, 8}, {0.12, 20}, {0.3, 11}, {0.45, 9}, {0.55, 27},
                                    {0.65, 53}, {0.75, 60}, {0.86, 36}, {0.95, 9}};
const std::vector<Key> kFootPitch = {{0.0, 16}, {0.08, 4}, {0.15, 0}, {0.38, 0}, {0.5, -20},
                                     {0.6, -50}, {0.68, -46}, {0.8, -8}, {0.9, 12}, {0.97, 17}};
const std::vector<Key> kToePitch = {{0.0, 4}, {0.15, 0}, {0.5, 22}, {0.6, 38}, {0.7, 14}, {0.82, 2}};

/// Local rotations by joint name, degrees of freedom not named stay at rest.
using Rotations = std::map<std::string, Quaterniond>;

void pose_leg(Rotations& pose, const std::string& side, double phase) {
  const double thigh = periodic(kThighForward, phase);
  const double knee = periodic(kKneeBend, phase);
  const double foot = periodic(kFootPitch, phase);
  pose[side + "_upper_leg"] = about_x(-thigh);  // about +x a positive turn swings the leg backwards
  pose[side + "_lower_leg"] = about_x(knee);
  pose[side + "_foot"] = about_x(-foot + thigh - knee);
  pose[side + "_toes"] = about_x(-periodic(kToePitch, phase));
}

/// `lowered`: degrees below the T pose; `swing`: forward; `bend`: of the elbow.
void pose_arm(Rotations& pose, const std::string& side, double lowered, double swing, double bend) {
  const double sign = side == "left" ? 1.0 : -1.0;
  pose[side + "_shoulder"] = about_z(-0.12 * sign * lowered);
  pose[side + "_upper_arm"] = about_x(-swing) * about_z(-0.88 * sign * lowered);
  pose[side + "_lower_arm"] = about_y(-sign * bend);
  pose[side + "_hand"] = about_z(-6.0 * sign);
}

Clip empty_clip(const std::string& name) {
  Clip clip;
  clip.name = name;
  clip.skeleton = ogre_clip_skeleton();
  clip.frames_per_second = kFramesPerSecond;
  return clip;
}

const std::vector<std::string>& rig_names() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const RigJoint& joint : ogre_rig().joints) list.push_back(joint.name);
    return list;
  }();
  return names;
}

/// Local transforms of one frame: the pose's rotations, the root at `root`.
std::vector<Transform> frame_of(const Clip& clip, const Rotations& pose, const Vector3d& root) {
  std::vector<Transform> local = clip.skeleton.rest;
  for (std::size_t joint = 0; joint < local.size(); ++joint) {
    if (const auto found = pose.find(rig_names()[joint]); found != pose.end()) local[joint].rotation = found->second;
  }
  local[0].translation = root;
  return local;
}

/// World positions of heel and ball of one foot when the root is where `local` puts it.
std::array<Vector3d, 2> sole(const Clip& clip, const std::vector<Transform>& local, const std::string& side) {
  const auto world = world_matrices(clip.skeleton, local);
  const RigSkeleton rig = ogre_rig();
  const int foot = rig.find(side + "_foot");
  const auto carried = [&](const Vector3d& rest) -> Vector3d {
    return world[foot] * (Vector3d(side == "left" ? rest : mirror(rest)) - rig.joints[foot].position);
  };
  return {carried(kHeel), carried(kBall)};
}

Rotations walk_pose(double phase) {
  const double c = std::cos(2.0 * std::numbers::pi * phase);
  const double s = std::sin(2.0 * std::numbers::pi * phase);
  Rotations pose;
  pose_leg(pose, "left", phase);
  pose_leg(pose, "right", phase + 0.5);
  // The hip of the leg in front goes forward, the shoulders go against it, the trunk leans over the standing leg.
  pose["hips"] = about_y(-6.0 * c) * about_z(2.5 * s) * about_x(3.0);
  pose["spine"] = about_y(4.0 * c) * about_z(-2.5 * s);
  pose["chest"] = about_y(5.0 * c) * about_z(-2.0 * s);
  pose["upper_chest"] = about_y(4.0 * c);
  pose["neck"] = about_y(-3.5 * c) * about_x(-2.0);
  pose["head"] = about_y(-3.5 * c) * about_x(-1.0);
  pose_arm(pose, "left", 52.0, -24.0 * c + 4.0, 26.0 - 10.0 * c);
  pose_arm(pose, "right", 52.0, 24.0 * c + 4.0, 26.0 + 10.0 * c);
  return pose;
}

double smooth_step(double from, double to, double t) {
  const double u = std::clamp((t - from) / (to - from), 0.0, 1.0);
  return u * u * (3.0 - 2.0 * u);
}

}  // namespace

RigSkeleton ogre_rig() {
  std::vector<std::string> storage;
  RigSkeleton rig;
  rig.mesh = "ogre.obj";
  for (const JointPlan& planned : both_sides(storage)) {
    RigJoint joint;
    joint.name = planned.name;
    joint.parent = rig.find(planned.parent);
    joint.position = planned.position;
    joint.role = role_from_name(planned.name);
    const bool left = is_left(joint.name);
    const auto sided = [&](const Vector3d& p) { return left ? p : mirror(p); };
    if (joint.name == "head") {
      joint.tip = kCrown;
      for (const double side : {1.0, -1.0}) {
        joint.helpers.push_back({{side * 0.11, 1.759, 0.027}, {side * 0.205, 1.796, -0.007}});
      }
    }
    if (joint.name == "left_hand" || joint.name == "right_hand") {
      joint.tip = sided(kFingerTip);
      joint.helpers = {{sided({0.915, 1.366, -0.046}), sided({0.998, 1.343, -0.073})},
                       {sided({0.915, 1.366, 0.058}), sided({0.996, 1.343, 0.089})},
                       {sided({0.842, 1.370, 0.060}), sided({0.867, 1.362, 0.120})}};
    }
    if (joint.name == "left_toes" || joint.name == "right_toes") joint.tip = sided(kToeTip);
    rig.joints.push_back(joint);
  }
  return rig;
}

Skeleton ogre_clip_skeleton() {
  std::vector<std::string> storage;
  const RigSkeleton rig = ogre_rig();
  const std::vector<JointPlan> joints = both_sides(storage);
  Skeleton skeleton;
  for (int joint = 0; joint < rig.joint_count(); ++joint) {
    const RigJoint& own = rig.joints[joint];
    skeleton.names.emplace_back(joints[joint].clip_name);
    skeleton.parents.push_back(own.parent);
    Transform rest;
    rest.translation = own.parent < 0 ? own.position : Vector3d(own.position - rig.joints[own.parent].position);
    skeleton.rest.push_back(rest);
    skeleton.tips.emplace_back();
    if (own.tip) skeleton.tips.back().push_back(*own.tip - own.position);
  }
  return skeleton;
}

Clip walk_clip() {
  constexpr int kFramesPerStride = 34;
  constexpr int kStrides = 4;
  Clip clip = empty_clip("walk");
  clip.frame_count = kStrides * kFramesPerStride + 1;
  Vector3d root = clip.skeleton.rest[0].translation;
  std::map<std::string, std::array<Vector3d, 2>> before;  // both soles, one frame ago
  for (int frame = 0; frame < clip.frame_count; ++frame) {
    const double phase = static_cast<double>(frame) / kFramesPerStride;
    const Rotations pose = walk_pose(phase);
    const double within = phase - std::floor(phase);
    const std::string standing = within >= 0.03 && within < 0.53 ? "left" : "right";
    std::vector<Transform> local = frame_of(clip, pose, root);
    if (frame > 0) {
      // Whichever end of the standing sole was on the ground stays where it was: the body moves over it.
      const std::array<Vector3d, 2>& was = before[standing];
      const int contact = was[0].y() <= was[1].y() ? 0 : 1;
      const Vector3d slid = sole(clip, local, standing)[contact] - was[contact];
      root -= Vector3d(slid.x(), 0.0, slid.z());
      local = frame_of(clip, pose, root);
    }
    double lowest = 1e9;
    for (const char* foot : {"left", "right"}) {
      for (const Vector3d& point : sole(clip, local, foot)) lowest = std::min(lowest, point.y());
    }
    root.y() -= lowest;
    local = frame_of(clip, pose, root);
    for (const char* foot : {"left", "right"}) before[foot] = sole(clip, local, foot);
    clip.local.insert(clip.local.end(), local.begin(), local.end());
  }
  return clip;
}

Clip wave_clip() {
  constexpr double kSeconds = 4.0;
  Clip clip = empty_clip("wave");
  clip.frame_count = static_cast<int>(kSeconds * kFramesPerSecond) + 1;
  const Vector3d root = clip.skeleton.rest[0].translation;
  for (int frame = 0; frame < clip.frame_count; ++frame) {
    const double t = frame / kFramesPerSecond;
    const double up = smooth_step(0.2, 1.0, t) * (1.0 - smooth_step(3.1, 3.9, t));
    const double swing = std::sin(2.0 * std::numbers::pi * 1.4 * (t - 0.9)) * up * smooth_step(0.7, 1.1, t);
    Rotations pose;
    pose_arm(pose, "left", 50.0, 3.0, 22.0);
    pose_arm(pose, "right", 50.0 - 78.0 * up, 3.0 + 10.0 * up, 22.0 * (1.0 - up));
    // The forearm stands up from the elbow and swings about the line of sight; the hand lags and twists.
    pose["right_lower_arm"] = about_y(22.0 * (1.0 - up)) * about_z(-58.0 * up - 24.0 * swing);
    pose["right_hand"] = about_x(35.0 * up) * about_z(6.0 - 16.0 * swing);
    pose["hips"] = about_z(1.5 * up);
    pose["spine"] = about_z(3.0 * up);
    pose["chest"] = about_z(3.0 * up) * about_y(-4.0 * up);
    pose["neck"] = about_z(-4.0 * up);
    pose["head"] = about_z(-5.0 * up + 2.0 * swing) * about_y(-8.0 * up);
    pose["left_upper_leg"] = about_z(-1.5 * up);
    pose["right_upper_leg"] = about_z(-1.5 * up);
    const std::vector<Transform> local = frame_of(clip, pose, root);
    clip.local.insert(clip.local.end(), local.begin(), local.end());
  }
  return clip;
}

}  // namespace sinew::samples
