#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "skeleton/pose.h"
#include "skeleton/roles.h"

namespace sinew {

/// A straight piece of body.
struct Segment {
  Eigen::Vector3d from = Eigen::Vector3d::Zero();
  Eigen::Vector3d to = Eigen::Vector3d::Zero();
};

/// One joint inside a mesh, in the mesh's own space and unit.
struct RigJoint {
  std::string name;
  int parent = -1;                              ///< smaller than the joint's own index; -1 at the root
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  std::optional<Role> role;
  std::optional<Eigen::Vector3d> tip;           ///< where a leaf's bone ends (finger tip, crown, toe)
  std::optional<double> cylinder_radius;        ///< of the bones this joint turns; unset: from local thickness
  std::optional<double> sphere_radius;          ///< of the joint's sphere; unset: from local thickness
  std::vector<Segment> helpers;                 ///< unboned extremities that follow this joint rigidly
};

/// Where a skeleton sits in a mesh at rest: what a rig file or a glTF bind pose says.
///
/// A joint here has no rest orientation: rest rotations are all identity, so a Pose of this
/// skeleton holds for each joint the rotation *from rest*.
struct RigSkeleton {
  std::string mesh;                                    ///< file name of the mesh it was made for; may be empty
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();       ///< of the body, in mesh space
  Eigen::Vector3d front = Eigen::Vector3d::UnitZ();    ///< where it looks, in mesh space
  std::vector<RigJoint> joints;                        ///< parents before children
  std::vector<std::pair<std::string, std::string>> map;  ///< rig joint name, clip joint name: overrides roles

  int joint_count() const { return static_cast<int>(joints.size()); }
  std::vector<int> parents() const;
  /// Index of the joint with that name, or -1.
  int find(std::string_view name) const;
};

/// The rest pose: joints where the rig puts them, rotations identity, scales one.
Pose rest_pose(const RigSkeleton& rig);

/// Throws std::invalid_argument naming the joint when an invariant above does not hold.
void check_rig_skeleton(const RigSkeleton& rig, const char* who);

}  // namespace sinew
