#pragma once

#include <vector>

#include "pipeline/binding.h"

namespace sinew {

/// Place on a segment nearest to a point.
struct Foot {
  double along = 0.0;     ///< 0 at the segment's start, 1 at its end; not clamped by foot_on()
  double distance = 0.0;  ///< from the point to the segment's line at `along`
};

/// The foot of `point` on the infinite line through `axis`, which must have some length.
Foot foot_on(const Segment& axis, const Eigen::Vector3d& point);

/// The nearest point of the segment itself.
Foot clamped_foot_on(const Segment& axis, const Eigen::Vector3d& point);

inline Eigen::Vector3d point_on(const Segment& axis, double along) {
  return axis.from + along * (axis.to - axis.from);
}

/// Local thickness R along a segment, at even steps with both ends; zero outside the body.
struct ThicknessProfile {
  std::vector<double> samples;
  double inside_share = 0.0;  ///< share of the samples inside the body

  double at(double along) const;  ///< linear between samples, clamped at the ends
  double mean() const;
};

/// One segment of a bone with what is known of the body round it.
struct BoneSegment {
  int bone = 0;
  Segment axis;
  int end_joint = -1;           ///< the child joint at axis.to; -1 at a tip or a helper
  bool helper = false;
  double length = 0.0;
  ThicknessProfile thickness;
  double cylinder_begin = 0.0;  ///< of the rotation cylinder, as a share of the segment
  double cylinder_end = 1.0;
  double radius_scale = 1.0;    ///< cylinder radius over thickness
  double fixed_radius = 0.0;    ///< the rig's own choice of cylinder radius; 0: none

  double cylinder_radius(double along) const {
    return fixed_radius > 0.0 ? fixed_radius : radius_scale * thickness.at(along);
  }
};

/// Where each bone and joint may take hold of the body. Depends on the surface and the skeleton only.
struct BoneRegions {
  std::vector<Bone> bones;
  std::vector<BoneSegment> segments;    ///< bone by bone, in the order of Bone::segments
  std::vector<int> bone_of_joint;       ///< -1 for a joint that turns nothing
  std::vector<double> joint_thickness;  ///< R at the joint; zero outside the body
  std::vector<double> sphere_radius;    ///< of the joint's sphere
};

BoneRegions bone_regions(const Solid& solid, const RigSkeleton& skeleton, const BindingOptions& options);

/// Shrinks the cylinders of bones that share no joint until two lattice constants lie between them,
/// wherever the body joins them in a straight line.
void keep_apart(const Solid& solid, const RigSkeleton& skeleton, double spacing, BoneRegions& regions);

/// Whether the two bones meet at a joint (parent and child, or children of one joint) or are one.
bool are_adjacent(const RigSkeleton& skeleton, const Bone& a, const Bone& b);

}  // namespace sinew
