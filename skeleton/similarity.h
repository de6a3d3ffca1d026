#pragma once

#include <optional>
#include <span>

#include <Eigen/Geometry>

namespace sinew {

/// A turn, then a scale, then a shift.
struct Similarity {
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  double scale = 1.0;
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();

  Eigen::Vector3d apply(const Eigen::Vector3d& point) const { return scale * (turn * point) + shift; }
};

/// The similarity that brings `from` closest to `to` in the least-squares sense; never a mirror
/// [Umeyama 1991, equations 40 to 42]. Points are paired by index. Nothing when either set is empty or
/// lies in one point. Points on one line leave the turn about that line open.
std::optional<Similarity> fit_similarity(std::span<const Eigen::Vector3d> from,
                                         std::span<const Eigen::Vector3d> to);

/// The largest distance that `similarity` leaves between paired points.
double misfit(const Similarity& similarity, std::span<const Eigen::Vector3d> from,
              std::span<const Eigen::Vector3d> to);

}  // namespace sinew
