#pragma once

#include <memory>

#include "pipeline/mesh.h"

namespace sinew {

/// Inside and outside of a surface that may be open, non-manifold or self-intersecting.
///
/// Queries are const and safe from several threads. Built on Embree; set-up O(n log n).
class Solid {
 public:
  explicit Solid(const TriMesh& mesh);
  ~Solid();
  Solid(Solid&&) noexcept;
  Solid& operator=(Solid&&) noexcept;

  /// Whether most of several fixed ray directions agree that `point` lies inside. Deterministic.
  bool contains(const Eigen::Vector3d& point) const;

  /// Distance to the nearest triangle, never negative.
  double distance(const Eigen::Vector3d& point) const;

  /// The nearest point of the surface.
  Eigen::Vector3d nearest(const Eigen::Vector3d& point) const;

  /// Whether the open segment between the two points crosses the surface. The ends may lie on it: a
  /// share of 1e-6 of the segment is left out at each.
  bool crosses(const Eigen::Vector3d& a, const Eigen::Vector3d& b) const;

 private:
  struct Members;
  std::unique_ptr<Members> members_;
};

}  // namespace sinew
