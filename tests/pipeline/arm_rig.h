#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "pipeline/rig.h"
#include "samples/shapes.h"

namespace sinew {

/// A straight arm along x: a capsule one metre long (half spheres beyond its ends) with a shoulder
/// at 0, an elbow at 0.5 and a wrist at 0.8, whose hand ends in a tip.
constexpr double kArmRadius = 0.08;

inline TriMesh arm_mesh(int around = 12) { return samples::arm(1.0, kArmRadius, 0.0, around); }

inline RigSkeleton arm_skeleton() {
  RigSkeleton rig;
  const auto joint = [&](const char* name, int parent, double x, Role role) {
    RigJoint added;
    added.name = name;
    added.parent = parent;
    added.position = {x, 0.0, 0.0};
    added.role = role;
    rig.joints.push_back(added);
  };
  joint("upper_arm", -1, 0.0, Role::left_upper_arm);
  joint("lower_arm", 0, 0.5, Role::left_lower_arm);
  joint("hand", 1, 0.8, Role::left_hand);
  rig.joints.back().tip = Eigen::Vector3d(1.04, 0.0, 0.0);
  return rig;
}

inline RigOptions arm_options(Deform deform, SolverKind solver = SolverKind::cholesky) {
  RigOptions options;
  options.binding = binding_options(deform);
  options.volume.spacing = 0.04;
  options.solver = solver;
  return options;
}

/// Local rotations, one a joint, on top of the rest pose: rest bone lengths, `root` moved by `shift`.
inline Pose posed(const RigSkeleton& rig, const std::vector<Eigen::Quaterniond>& local,
                  const Eigen::Vector3d& shift = Eigen::Vector3d::Zero()) {
  Pose pose = rest_pose(rig);
  for (int joint = 0; joint < rig.joint_count(); ++joint) {
    const int parent = rig.joints[joint].parent;
    pose.rotations[joint] = local[joint];
    pose.positions[joint] += shift;
    if (parent < 0) continue;
    const Eigen::Vector3d arm = rig.joints[joint].position - rig.joints[parent].position;
    pose.positions[joint] = pose.positions[parent] + pose.rotations[parent] * arm;
    pose.rotations[joint] = pose.rotations[parent] * local[joint];
  }
  return pose;
}

/// A rotation whose sign follows the angle: no jump anywhere, -q at a full turn.
inline Eigen::Quaterniond turn(double degrees, const Eigen::Vector3d& axis) {
  const double half = degrees * std::numbers::pi / 360.0;
  const Eigen::Vector3d v = std::sin(half) * axis.normalized();
  return {std::cos(half), v.x(), v.y(), v.z()};
}

/// The arm with its elbow bent in the xy plane and its hand twisted about the arm.
inline Pose bent_arm(double elbow_degrees, double twist_degrees = 0.0) {
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
  return posed(arm_skeleton(), {none, turn(elbow_degrees, {0, 0, 1}), turn(twist_degrees, {1, 0, 0})});
}

/// Two surfaces in one mesh.
inline TriMesh joined(const TriMesh& a, const TriMesh& b) {
  TriMesh both = a;
  both.positions.conservativeResize(a.vertex_count() + b.vertex_count(), Eigen::NoChange);
  both.positions.bottomRows(b.vertex_count()) = b.positions;
  for (auto triangle : b.triangles) {
    for (int& vertex : triangle) vertex += a.vertex_count();
    both.triangles.push_back(triangle);
  }
  return both;
}

inline TriMesh moved(TriMesh mesh, const Eigen::Vector3d& shift) {
  mesh.positions.rowwise() += shift.transpose();
  return mesh;
}

inline double largest_difference(const Field3& a, const Field3& b) { return (a - b).rowwise().norm().maxCoeff(); }

inline bool mentions(const std::vector<std::string>& warnings, const std::string& text) {
  return std::any_of(warnings.begin(), warnings.end(),
                     [&](const std::string& warning) { return warning.find(text) != std::string::npos; });
}

}  // namespace sinew
