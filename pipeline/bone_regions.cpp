// Bone cylinders and joint spheres after [Shi et al. 2006, section 7], sized by local thickness: the
// ball round an axis point with the distance to the surface as radius holds no surface point, so a
// thinner cylinder stays within its own limb.
#include "pipeline/bone_regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace sinew {
namespace {

/// Samples of local thickness along a segment. Thickness changes by at most the distance walked, so
/// linear interpolation is right to a thirty-second of the segment's length.
constexpr int kThicknessSamples = 33;

/// What is left of a cylinder whose trimmed ends would meet, as a share of its segment.
constexpr double kLeastCylinder = 0.2;

/// Segments shorter than this share of the skeleton's extent move nothing.
constexpr double kLeastSegment = 1e-6;

double extent_of(const RigSkeleton& skeleton) {
  Eigen::AlignedBox3d box;
  for (const RigJoint& joint : skeleton.joints) {
    box.extend(joint.position);
    if (joint.tip) box.extend(*joint.tip);
  }
  return box.isEmpty() ? 0.0 : box.diagonal().norm();
}

double length_of(const Segment& segment) {
  return (segment.to - segment.from).norm();
}

ThicknessProfile measure_thickness(const Solid& solid, const Segment& axis) {
  ThicknessProfile profile;
  profile.samples.resize(kThicknessSamples);
  int inside = 0;
  for (int sample = 0; sample < kThicknessSamples; ++sample) {
    const Eigen::Vector3d point = point_on(axis, sample / (kThicknessSamples - 1.0));
    const bool within = solid.contains(point);
    inside += within ? 1 : 0;
    profile.samples[sample] = within ? solid.distance(point) : 0.0;
  }
  profile.inside_share = static_cast<double>(inside) / kThicknessSamples;
  return profile;
}

/// A bone's segments before they are measured: children first, then the tip, then helpers.
std::vector<BoneSegment> segments_of(const RigSkeleton& skeleton, int joint, double least) {
  const RigJoint& own = skeleton.joints[joint];
  std::vector<BoneSegment> segments;
  const auto add = [&](const Segment& axis, int end_joint, bool helper) {
    if (!(length_of(axis) > least)) return;
    BoneSegment segment;
    segment.axis = axis;
    segment.end_joint = end_joint;
    segment.helper = helper;
    segment.length = length_of(axis);
    segment.fixed_radius = own.cylinder_radius.value_or(0.0);
    segments.push_back(std::move(segment));
  };
  for (int child = joint + 1; child < skeleton.joint_count(); ++child) {
    if (skeleton.joints[child].parent == joint)
      add({own.position, skeleton.joints[child].position}, child, false);
  }
  if (own.tip) add({own.position, *own.tip}, -1, false);
  for (const Segment& helper : own.helpers) add(helper, -1, true);
  return segments;
}

bool has_role(const RigJoint& joint, std::initializer_list<Role> roles) {
  return joint.role && std::find(roles.begin(), roles.end(), *joint.role) != roles.end();
}

/// The segment a twisting bone turns about: the longest of those that end at a joint, or failing
/// that the longest; -1 when there is none.
int main_segment(const std::vector<BoneSegment>& segments) {
  int best = -1;
  for (int k = 0; k < static_cast<int>(segments.size()); ++k) {
    const auto rank = [&](int s) { return std::pair(segments[s].end_joint >= 0, segments[s].length); };
    if (!segments[k].helper && (best < 0 || rank(k) > rank(best))) best = k;
  }
  return best;
}

Bone make_bone(const RigSkeleton& skeleton, int joint, const std::vector<BoneSegment>& segments,
               bool twist_fields) {
  Bone bone;
  bone.joint = joint;
  for (const BoneSegment& segment : segments) bone.segments.push_back(segment.axis);
  const RigJoint& own = skeleton.joints[joint];
  const bool forearm = has_role(own, {Role::left_lower_arm, Role::right_lower_arm});
  const bool limb = forearm || has_role(own, {Role::left_upper_arm, Role::right_upper_arm,
                                              Role::left_upper_leg, Role::right_upper_leg});
  const int along = main_segment(segments);
  if (!twist_fields || !limb || along < 0) return bone;
  bone.twists = true;
  bone.axis = (segments[along].axis.to - segments[along].axis.from).normalized();
  if (forearm) bone.twisted_by = segments[along].end_joint;
  return bone;
}

/// Mean thickness would hide a joint near the skin: R at the joint itself decides.
double sphere_radius_of(const RigSkeleton& skeleton, const BindingOptions& options, int joint,
                        double thickness, double shortest_bone) {
  if (skeleton.joints[joint].sphere_radius) return *skeleton.joints[joint].sphere_radius;
  return std::min(options.sphere_share * thickness, options.sphere_bone_cap * shortest_bone);
}

std::vector<double> shortest_incident_bones(const RigSkeleton& skeleton, const BoneRegions& regions) {
  std::vector<double> shortest(skeleton.joints.size(), std::numeric_limits<double>::infinity());
  for (const BoneSegment& segment : regions.segments) {
    if (segment.helper) continue;
    for (const int joint : {regions.bones[segment.bone].joint, segment.end_joint}) {
      if (joint >= 0) shortest[joint] = std::min(shortest[joint], segment.length);
    }
  }
  return shortest;
}

/// The part of the segment further than its joints' trimming distance from them. Where nothing would be
/// left, a fifth of it: the middle, or at the root, where no other bone begins, the start. A pelvis held in
/// the middle of its sides would be nearer to the hips than the thighs, and the hips would hardly
/// listen to the thighs. A helper need not start at its joint, so it is walked from its start until
/// it is clear of all joints of its bone.
void trim(const RigSkeleton& skeleton, const BoneRegions& regions, double share, BoneSegment& segment) {
  const int own_joint = regions.bones[segment.bone].joint;
  double begin = 0.0;
  double end = 1.0;
  if (!segment.helper) {
    begin = share * regions.joint_thickness[own_joint] / segment.length;
    if (segment.end_joint >= 0) end -= share * regions.joint_thickness[segment.end_joint] / segment.length;
  } else {
    const auto near_joint = [&](double along) {
      const Eigen::Vector3d point = point_on(segment.axis, along);
      for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
        if (joint != own_joint && skeleton.joints[joint].parent != own_joint) continue;
        const double reach = share * regions.joint_thickness[joint];
        if ((point - skeleton.joints[joint].position).norm() < reach) return true;
      }
      return false;
    };
    constexpr double step = 1.0 / (kThicknessSamples - 1.0);
    while (begin < 1.0 && near_joint(begin)) begin += step;
  }
  if (end - begin < kLeastCylinder) {
    const bool from_root = !segment.helper && skeleton.joints[own_joint].parent < 0;
    begin = from_root ? 0.0 : 0.5 * (1.0 - kLeastCylinder);
    end = begin + kLeastCylinder;
  }
  segment.cylinder_begin = begin;
  segment.cylinder_end = end;
}

Segment cylinder_axis(const BoneSegment& segment) {
  return {point_on(segment.axis, segment.cylinder_begin), point_on(segment.axis, segment.cylinder_end)};
}

double widest_radius(const BoneSegment& segment) {
  double widest = 0.0;
  for (int sample = 0; sample < kThicknessSamples; ++sample) {
    const double share = sample / (kThicknessSamples - 1.0);
    const double along = segment.cylinder_begin + share * (segment.cylinder_end - segment.cylinder_begin);
    widest = std::max(widest, segment.cylinder_radius(along));
  }
  return widest;
}

/// The nearest pair of points of two segments, by alternating projection from the best of a few
/// starts: exact enough to compare with a lattice constant.
std::pair<Eigen::Vector3d, Eigen::Vector3d> nearest_points(const Segment& a, const Segment& b) {
  std::pair<Eigen::Vector3d, Eigen::Vector3d> best{a.from, b.from};
  double best_distance = std::numeric_limits<double>::infinity();
  for (const double start : {0.0, 0.25, 0.5, 0.75, 1.0}) {
    Eigen::Vector3d on_a = point_on(a, start);
    Eigen::Vector3d on_b;
    for (int round = 0; round < 20; ++round) {
      on_b = point_on(b, clamped_foot_on(b, on_a).along);
      on_a = point_on(a, clamped_foot_on(a, on_b).along);
    }
    const double distance = (on_a - on_b).norm();
    if (distance < best_distance) {
      best_distance = distance;
      best = {on_a, on_b};
    }
  }
  return best;
}

}  // namespace

Foot foot_on(const Segment& axis, const Eigen::Vector3d& point) {
  const Eigen::Vector3d direction = axis.to - axis.from;
  const double along = (point - axis.from).dot(direction) / direction.squaredNorm();
  return {along, (point - point_on(axis, along)).norm()};
}

Foot clamped_foot_on(const Segment& axis, const Eigen::Vector3d& point) {
  const double along = std::clamp(foot_on(axis, point).along, 0.0, 1.0);
  return {along, (point - point_on(axis, along)).norm()};
}

double ThicknessProfile::at(double along) const {
  const double place = std::clamp(along, 0.0, 1.0) * (kThicknessSamples - 1);
  const int below = std::min(static_cast<int>(place), kThicknessSamples - 2);
  const double share = place - below;
  return (1.0 - share) * samples[below] + share * samples[below + 1];
}

double ThicknessProfile::mean() const {
  double sum = 0.0;
  for (const double sample : samples) sum += sample;
  return sum / static_cast<double>(samples.size());
}

BoneRegions bone_regions(const Solid& solid, const RigSkeleton& skeleton, const BindingOptions& options) {
  check_rig_skeleton(skeleton, "bind");
  BoneRegions regions;
  const double least = kLeastSegment * extent_of(skeleton);
  regions.bone_of_joint.assign(skeleton.joints.size(), -1);
  for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
    const Eigen::Vector3d& position = skeleton.joints[joint].position;
    regions.joint_thickness.push_back(solid.contains(position) ? solid.distance(position) : 0.0);
    std::vector<BoneSegment> segments = segments_of(skeleton, joint, least);
    if (segments.empty()) continue;
    const int bone = static_cast<int>(regions.bones.size());
    regions.bone_of_joint[joint] = bone;
    regions.bones.push_back(make_bone(skeleton, joint, segments, options.twist_fields));
    for (BoneSegment& segment : segments) {
      segment.bone = bone;
      segment.thickness = measure_thickness(solid, segment.axis);
      segment.radius_scale = options.cylinder_share;
      regions.segments.push_back(std::move(segment));
    }
  }
  const std::vector<double> shortest = shortest_incident_bones(skeleton, regions);
  for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
    const double thickness = regions.joint_thickness[joint];
    regions.sphere_radius.push_back(sphere_radius_of(skeleton, options, joint, thickness, shortest[joint]));
  }
  for (BoneSegment& segment : regions.segments) trim(skeleton, regions, options.trim_share, segment);
  return regions;
}

bool are_adjacent(const RigSkeleton& skeleton, const Bone& a, const Bone& b) {
  const int parent_a = skeleton.joints[a.joint].parent;
  const int parent_b = skeleton.joints[b.joint].parent;
  return a.joint == b.joint || parent_a == b.joint || parent_b == a.joint ||
         (parent_a >= 0 && parent_a == parent_b);
}

void keep_apart(const Solid& solid, const RigSkeleton& skeleton, double spacing, BoneRegions& regions) {
  // Below this share of its radius a cylinder would hold nothing; axis nodes serve it better.
  constexpr double least_share = 0.25;
  std::vector<double> share(regions.segments.size(), 1.0);
  for (std::size_t first = 0; first < regions.segments.size(); ++first) {
    for (std::size_t second = first + 1; second < regions.segments.size(); ++second) {
      const BoneSegment& a = regions.segments[first];
      const BoneSegment& b = regions.segments[second];
      if (are_adjacent(skeleton, regions.bones[a.bone], regions.bones[b.bone])) continue;
      const auto [on_a, on_b] = nearest_points(cylinder_axis(a), cylinder_axis(b));
      const double distance = (on_a - on_b).norm();
      const double reach = widest_radius(a) + widest_radius(b);
      if (reach + 2.0 * spacing <= distance || solid.crosses(on_a, on_b)) continue;
      const double fitting = std::max(least_share, (distance - 2.0 * spacing) / reach);
      share[first] = std::min(share[first], fitting);
      share[second] = std::min(share[second], fitting);
    }
  }
  for (std::size_t k = 0; k < share.size(); ++k) {
    regions.segments[k].radius_scale *= share[k];
    regions.segments[k].fixed_radius *= share[k];
  }
}

}  // namespace sinew
