#pragma once

#include <Eigen/Geometry>

namespace sinew {

/// A joint's placement relative to its parent: scale first, then rotation, then translation.
struct Transform {
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();  ///< unit length
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();

  Eigen::Affine3d matrix() const;
};

/// Rotation closest to the linear part of `matrix` (polar factor, determinant +1). A mirrored
/// matrix gives the rotation closest to its un-mirrored form (the mirror is taken off along x).
Eigen::Quaterniond nearest_rotation(const Eigen::Matrix3d& matrix);

}  // namespace sinew
