#include "skeleton/similarity.h"

#include <algorithm>
#include <cmath>

#include <Eigen/SVD>

namespace sinew {
namespace {

Eigen::Vector3d centre_of(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) sum += point;
  return sum / static_cast<double>(points.size());
}

}  // namespace

std::optional<Similarity> fit_similarity(std::span<const Eigen::Vector3d> from,
                                         std::span<const Eigen::Vector3d> to) {
  if (from.empty() || from.size() != to.size()) return std::nullopt;
  const Eigen::Vector3d from_centre = centre_of(from), to_centre = centre_of(to);
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  double spread = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    covariance += (to[i] - to_centre) * (from[i] - from_centre).transpose();
    spread += (from[i] - from_centre).squaredNorm();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign = Eigen::Vector3d::Ones();
  // The weakest axis pays for a mirror: flat point sets leave its sign open anyway.
  sign.z() = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Matrix3d turn = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  Similarity fit;
  fit.turn = Eigen::Quaterniond(turn).normalized();
  fit.scale = turn.cwiseProduct(covariance).sum() / spread;
  if (!(spread > 0.0) || !(fit.scale > 0.0) || !std::isfinite(fit.scale)) return std::nullopt;
  fit.shift = to_centre - fit.scale * (fit.turn * from_centre);
  return fit;
}

double misfit(const Similarity& similarity, std::span<const Eigen::Vector3d> from,
              std::span<const Eigen::Vector3d> to) {
  double worst = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i)
    worst = std::max(worst, (similarity.apply(from[i]) - to[i]).norm());
  return worst;
}

}  // namespace sinew
