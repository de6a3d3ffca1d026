#pragma once

#include <array>
#include <optional>
#include <span>

#include "skeleton/roles.h"

namespace sinew {

/// Joint index of each role in some skeleton, -1 where nobody plays it. Indexed by Role.
using BodyJoints = std::array<int, kRoleCount>;

inline int joint_of(const BodyJoints& joints, Role role) {
  return joints[static_cast<int>(role)];
}

/// The landmarks of a body at one instant: a view, which outlives neither of its parts.
struct Body {
  std::span<const Eigen::Vector3d> positions;  ///< per joint, in world space
  const BodyJoints& joints;

  bool has(Role role) const { return joint_of(joints, role) >= 0; }
  const Eigen::Vector3d& at(Role role) const { return positions[joint_of(joints, role)]; }
  /// Halfway between two landmarks; nothing unless both are there.
  std::optional<Eigen::Vector3d> middle(Role left, Role right) const;
};

/// The part of `vector` at right angles to the unit vector `axis`.
Eigen::Vector3d across(const Eigen::Vector3d& vector, const Eigen::Vector3d& axis);

/// Towards the body's left, unit length and at right angles to `up`: from the line through the hip
/// joints and that through the shoulders. Nothing when neither is known or both run along `up`.
std::optional<Eigen::Vector3d> left_of(const Body& body, const Eigen::Vector3d& up);

/// Lower spine to neck or head: the middle of the hip joints (or the hips) to the topmost landmark.
std::optional<Eigen::Vector3d> trunk_of(const Body& body);

/// Thigh plus shin, mean of both sides; shin to the foot only where feet are known. 0 without legs.
double leg_length(const Body& body, bool with_feet);

/// How far a body is from standing straight in a T, A or I, as the worst of its faults, each in
/// units of what is still called standing: trunk 20 degrees from `up`, thigh-to-foot 25 degrees from
/// down and as much from its mirror image, knees and elbows bent by 30 degrees, arms 30 degrees from
/// their mirror image, 45 degrees out of the frontal plane, raised 100 degrees from down.
/// At most 1 means standing. Infinite when the body has no hips, legs or trunk to judge by.
double stance_fault(const Body& body, const Eigen::Vector3d& up);

}  // namespace sinew
