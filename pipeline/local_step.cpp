// Second-order steps on the rotation group for the orthogonal Procrustes problem: the derivative of
// trace(exp([w])^T B), B = R^T S, is the axial part of B, its second derivative -(trace(P) I - P) with
// P the symmetric part of B.
#include "pipeline/local_step.h"

#include <cmath>

namespace sinew {
namespace {

/// Newton doubles the digits each time; from a blended rotation two or three steps are the rule.
constexpr int kMostSteps = 12;
constexpr double kSmallTurn = 1e-8;  ///< radians; the next step would be its square

/// Share of the neighborhood's size that holds a direction in place which its edges leave open.
constexpr double kStiffness = 1e-6;

Eigen::Quaterniond small_turn(const Eigen::Vector3d& turn) {
  const double angle = turn.norm();
  const double half = angle < 1e-4 ? 0.5 - angle * angle / 48.0 : std::sin(0.5 * angle) / angle;
  return {std::cos(0.5 * angle), half * turn.x(), half * turn.y(), half * turn.z()};
}

}  // namespace

Eigen::Quaterniond closest_rotation(const Eigen::Matrix3d& sum, const Eigen::Quaterniond& start) {
  Eigen::Quaterniond rotation = start;
  const double size = sum.norm();
  if (!(size > 0.0) || !std::isfinite(size)) return start;
  for (int step = 0; step < kMostSteps; ++step) {
    const Eigen::Matrix3d B = rotation.toRotationMatrix().transpose() * sum;
    const Eigen::Vector3d slope(B(2, 1) - B(1, 2), B(0, 2) - B(2, 0), B(1, 0) - B(0, 1));
    Eigen::Matrix3d curvature = -0.5 * (B + B.transpose());
    curvature.diagonal().array() += B.trace() + kStiffness * size;
    // Far from the maximum the curvature may point the wrong way; the gradient never does.
    const double minor = curvature(0, 0) * curvature(1, 1) - curvature(0, 1) * curvature(1, 0);
    const double determinant = curvature.determinant();
    const bool curved = curvature(0, 0) > 0.0 && minor > 0.0 && determinant > 1e-12 * size * size * size;
    Eigen::Vector3d turn = curved ? Eigen::Vector3d(curvature.inverse() * slope) : Eigen::Vector3d(slope / size);
    const double angle = turn.norm();
    constexpr double longest = 1.0;  // radian; beyond it the quadratic model says little
    if (angle > longest) turn *= longest / angle;
    rotation = (rotation * small_turn(turn)).normalized();
    if (angle < kSmallTurn) break;
  }
  return rotation;
}

}  // namespace sinew
