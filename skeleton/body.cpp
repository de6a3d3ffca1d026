#include "skeleton/body.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace sinew {
namespace {

/// Lengths below this share of another length give no direction.
constexpr double kNoLength = 1e-6;

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

/// The four joints of an arm or a leg that its stance is judged by: root, bend, end.
struct Limb {
  Eigen::Vector3d root, bend, end;
  Eigen::Vector3d reach() const { return end - root; }
  double bend_angle() const { return degrees_between(bend - root, end - bend); }
};

std::optional<Limb> limb(const Body& body, Role root, Role bend, Role end) {
  if (!body.has(root) || !body.has(bend) || !body.has(end)) return std::nullopt;
  return Limb{body.at(root), body.at(bend), body.at(end)};
}

/// `left` seen in a mirror on the plane at right angles to `axis`, against `right`.
double degrees_from_mirror(const Eigen::Vector3d& left, const Eigen::Vector3d& right,
                           const Eigen::Vector3d& axis) {
  return degrees_between(left - 2.0 * left.dot(axis) * axis, right);
}

double leg_fault(const Limb& left, const Limb& right, const Eigen::Vector3d& up,
                 const Eigen::Vector3d& to_left) {
  return std::max({degrees_between(left.reach(), -up) / 25.0, degrees_between(right.reach(), -up) / 25.0,
                   degrees_from_mirror(left.reach(), right.reach(), to_left) / 25.0, left.bend_angle() / 30.0,
                   right.bend_angle() / 30.0});
}

double arm_fault(const Limb& left, const Limb& right, const Eigen::Vector3d& up,
                 const Eigen::Vector3d& to_left) {
  const Eigen::Vector3d front = to_left.cross(up);
  double worst = degrees_from_mirror(left.reach(), right.reach(), to_left) / 30.0;
  for (const Limb& arm : {left, right}) {
    const double out_of_plane = std::abs(90.0 - degrees_between(arm.reach(), front));
    const double raised = std::max(0.0, degrees_between(arm.reach(), -up) - 90.0);
    worst = std::max({worst, out_of_plane / 45.0, raised / 10.0, arm.bend_angle() / 30.0});
  }
  return worst;
}

}  // namespace

std::optional<Eigen::Vector3d> Body::middle(Role left, Role right) const {
  if (!has(left) || !has(right)) return std::nullopt;
  return Eigen::Vector3d(0.5 * (at(left) + at(right)));
}

Eigen::Vector3d across(const Eigen::Vector3d& vector, const Eigen::Vector3d& axis) {
  return vector - vector.dot(axis) * axis;
}

std::optional<Eigen::Vector3d> left_of(const Body& body, const Eigen::Vector3d& up) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const std::pair<Role, Role> pairs[] = {{Role::left_upper_leg, Role::right_upper_leg},
                                         {Role::left_upper_arm, Role::right_upper_arm}};
  for (const auto& [left, right] : pairs) {
    if (!body.has(left) || !body.has(right)) continue;
    const Eigen::Vector3d line = body.at(left) - body.at(right);
    const Eigen::Vector3d level = across(line, up);
    if (level.norm() > kNoLength * line.norm()) sum += level.normalized();
  }
  if (sum.norm() < kNoLength) return std::nullopt;
  return sum.normalized();
}

std::optional<Eigen::Vector3d> trunk_of(const Body& body) {
  std::optional<Eigen::Vector3d> low = body.middle(Role::left_upper_leg, Role::right_upper_leg);
  if (!low && body.has(Role::hips)) low = body.at(Role::hips);
  if (!low) return std::nullopt;
  for (const Role top : {Role::neck, Role::head})
    if (body.has(top)) return Eigen::Vector3d(body.at(top) - *low);
  if (const auto shoulders = body.middle(Role::left_upper_arm, Role::right_upper_arm))
    return Eigen::Vector3d(*shoulders - *low);
  return std::nullopt;
}

double leg_length(const Body& body, bool with_feet) {
  double sum = 0.0;
  for (const Role thigh : {Role::left_upper_leg, Role::right_upper_leg}) {
    const Role shin = static_cast<Role>(static_cast<int>(thigh) + 1);
    const Role foot = static_cast<Role>(static_cast<int>(thigh) + 2);
    if (!body.has(thigh) || !body.has(shin) || (with_feet && !body.has(foot))) return 0.0;
    sum += (body.at(shin) - body.at(thigh)).norm();
    if (with_feet) sum += (body.at(foot) - body.at(shin)).norm();
  }
  return 0.5 * sum;
}

double stance_fault(const Body& body, const Eigen::Vector3d& up) {
  const auto trunk = trunk_of(body);
  const auto to_left = left_of(body, up);
  const auto left_leg = limb(body, Role::left_upper_leg, Role::left_lower_leg, Role::left_foot);
  const auto right_leg = limb(body, Role::right_upper_leg, Role::right_lower_leg, Role::right_foot);
  if (!trunk || !to_left || !left_leg || !right_leg) return std::numeric_limits<double>::infinity();
  double worst = std::max(degrees_between(*trunk, up) / 20.0, leg_fault(*left_leg, *right_leg, up, *to_left));
  const auto left_arm = limb(body, Role::left_upper_arm, Role::left_lower_arm, Role::left_hand);
  const auto right_arm = limb(body, Role::right_upper_arm, Role::right_lower_arm, Role::right_hand);
  if (left_arm && right_arm) worst = std::max(worst, arm_fault(*left_arm, *right_arm, up, *to_left));
  return worst;
}

}  // namespace sinew
