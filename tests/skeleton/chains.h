#pragma once

#include <numbers>
#include <vector>

#include "skeleton/pose.h"

namespace sinew::chains {

inline Eigen::Quaterniond turn_about_x(double degrees) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, Eigen::Vector3d::UnitX()));
}
inline Eigen::Quaterniond turn_about_z(double degrees) {
  return Eigen::Quaterniond(Eigen::AngleAxisd(degrees * std::numbers::pi / 180.0, Eigen::Vector3d::UnitZ()));
}

/// root - arm - hand, each a unit along x from the one before, and a leg below the root:
///
///     root --- arm --- hand
///      |
///     leg
inline Skeleton figure() {
  Skeleton skeleton;
  skeleton.names = {"root", "arm", "hand", "leg"};
  skeleton.parents = {-1, 0, 1, 0};
  skeleton.rest.resize(4);
  skeleton.rest[1].translation = skeleton.rest[2].translation = Eigen::Vector3d::UnitX();
  skeleton.rest[3].translation = -Eigen::Vector3d::UnitY();
  skeleton.tips.resize(4);
  return skeleton;
}

}  // namespace sinew::chains
