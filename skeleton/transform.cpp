#include "skeleton/transform.h"

#include <Eigen/SVD>

namespace sinew {

Eigen::Affine3d Transform::matrix() const {
  Eigen::Affine3d result = Eigen::Affine3d::Identity();
  result.linear() = rotation.toRotationMatrix() * scale.asDiagonal();
  result.translation() = translation;
  return result;
}

Eigen::Quaterniond nearest_rotation(const Eigen::Matrix3d& matrix) {
  Eigen::Matrix3d proper = matrix;
  if (proper.determinant() < 0.0) proper.col(0) = -proper.col(0);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(proper, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // A singular matrix leaves the signs of its factors open: choose them so that the product turns.
  Eigen::Matrix3d sign = Eigen::Matrix3d::Identity();
  sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return Eigen::Quaterniond(svd.matrixU() * sign * svd.matrixV().transpose()).normalized();
}

}  // namespace sinew
