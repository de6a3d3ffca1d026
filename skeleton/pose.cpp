#include "skeleton/pose.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace sinew {
namespace {

/// Least scale a pose reports. A joint scaled to nothing hides a prop; those who divide by a scale
/// must still get numbers. A share of the joint's size at rest, far below anything to be seen.
constexpr double kLeastScale = 1e-12;

void check_local(const Skeleton& skeleton, std::span<const Transform> local, const char* who) {
  if (local.size() == skeleton.parents.size()) return;
  throw std::invalid_argument(std::string(who) + ": " + std::to_string(local.size()) + " transforms for " +
                              std::to_string(skeleton.parents.size()) + " joints; expected one per joint");
}

double size_of(const Eigen::Matrix3d& linear) {
  return std::max(kLeastScale, std::cbrt(std::abs(linear.determinant())));
}

/// The rotation of joint relative to parent, -1 standing for the world.
Eigen::Quaterniond relative_rotation(const Pose& pose, int joint, int parent) {
  return parent < 0 ? pose.rotations[joint] : pose.rotations[parent].conjugate() * pose.rotations[joint];
}

void turn_sign(Eigen::Quaterniond& rotation) { rotation.coeffs() = -rotation.coeffs(); }

}  // namespace

std::vector<Eigen::Affine3d> world_matrices(const Skeleton& skeleton, std::span<const Transform> local) {
  check_local(skeleton, local, "world_matrices");
  std::vector<Eigen::Affine3d> world(local.size());
  for (std::size_t joint = 0; joint < local.size(); ++joint) {
    const int parent = skeleton.parents[joint];
    world[joint] = parent < 0 ? local[joint].matrix() : world[parent] * local[joint].matrix();
  }
  return world;
}

Pose forward_kinematics(const Skeleton& skeleton, std::span<const Transform> local) {
  check_local(skeleton, local, "forward_kinematics");
  const std::vector<Eigen::Affine3d> world = world_matrices(skeleton, local);
  Pose pose{std::vector<Eigen::Vector3d>(local.size()), std::vector<Eigen::Quaterniond>(local.size()),
            std::vector<double>(local.size(), 1.0)};
  std::vector<bool> rigid(local.size());
  for (std::size_t joint = 0; joint < local.size(); ++joint) {
    const int parent = skeleton.parents[joint];
    pose.positions[joint] = world[joint].translation();
    rigid[joint] = local[joint].scale == Eigen::Vector3d::Ones() && (parent < 0 || rigid[parent]);
    if (rigid[joint]) {  // without scale above, the product of rotations is the nearest rotation, and cheaper
      const Eigen::Quaterniond& own = local[joint].rotation;
      pose.rotations[joint] = (parent < 0 ? own : pose.rotations[parent] * own).normalized();
    } else {
      pose.rotations[joint] = nearest_rotation(world[joint].linear());
      pose.scales[joint] = size_of(world[joint].linear());
    }
  }
  return pose;
}

void make_continuous(std::span<Pose> poses, std::span<const int> parents) {
  std::vector<Eigen::Quaterniond> before(parents.size(), Eigen::Quaterniond::Identity());
  for (Pose& pose : poses) {
    if (pose.rotations.size() != parents.size()) {
      throw std::invalid_argument("make_continuous: a pose has " + std::to_string(pose.rotations.size()) +
                                  " joints; expected " + std::to_string(parents.size()));
    }
    for (std::size_t joint = 0; joint < parents.size(); ++joint) {
      // The parent's sign is settled by now. At the first pose `before` is the identity, whose side
      // is that of non-negative real parts.
      Eigen::Quaterniond relative = relative_rotation(pose, static_cast<int>(joint), parents[joint]);
      if (relative.dot(before[joint]) < 0.0) {
        turn_sign(pose.rotations[joint]);
        turn_sign(relative);
      }
      before[joint] = relative;
    }
  }
}

}  // namespace sinew
