#pragma once

#include <Eigen/Geometry>

namespace sinew {

/// The rotation R that maximises trace(R^T S), S the sum of w e' e^T over a node's edges (e at rest, e'
/// deformed): the local step of as-rigid-as-possible deformation [Sorkine and Alexa 2007].
///
/// Newton's method on rotations from the unit quaternion `start`, which also decides the directions
/// that a flat or straight neighborhood leaves open. Proper (determinant +1) also where the neighborhood is turned
/// inside out. Zero and non-finite sums give `start`.
Eigen::Quaterniond closest_rotation(const Eigen::Matrix3d& sum, const Eigen::Quaterniond& start);

}  // namespace sinew
