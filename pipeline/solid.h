#pragma once

#include <limits>
#include <memory>
#include <vector>

#include "pipeline/mesh.h"

namespace sinew {

/// A place where a segment meets the surface.
struct Crossing {
  double share = 0.0;  ///< place on the segment: 0 at its first end, 1 at its second
  int change = 0;      ///< of the winding number: +1 entering the body, -1 leaving it
  int triangle = -1;   ///< of the mesh; -1: a lid over a hole
  int component = 0;   ///< connected component of the surface, numbered by its smallest vertex
};

/// Inside and outside of a surface that may be open, non-manifold or self-intersecting.
///
/// Inside is where the winding number is not 0, which is also right where limbs overlap. An open
/// surface has no winding number, so every hole is closed by a lid, a fan of triangles round the
/// middle of its rim; a triangle turned the wrong way counts as a hole closed twice. Lids bound the
/// inside like the surface itself; only distances ignore them.
///
/// Positions are scaled to the unit box, so size and place of the mesh do not matter. Queries are
/// const and safe from several threads. Built on Embree, whose single-precision answers are only
/// candidates, decided again in double precision; set-up O(n log n).
class Solid {
 public:
  /// Triangles with a vertex that is not finite are left out, the second and later ones over the same
  /// three vertices too. Throws std::invalid_argument when a triangle names a vertex that is not there.
  explicit Solid(const TriMesh& mesh);
  ~Solid();
  Solid(Solid&&) noexcept;
  Solid& operator=(Solid&&) noexcept;

  /// Whether the surface is closed and all its triangles are turned the same way: no lid was needed.
  bool closed() const;

  /// Whether most of several fixed lines through `point` agree that it lies inside. Deterministic.
  bool contains(const Eigen::Vector3d& point) const;

  /// Distance to the nearest triangle, never negative, or `limit` when nothing is nearer than that;
  /// a small limit makes the query cheap. Infinite for an empty mesh without a limit.
  double distance(const Eigen::Vector3d& point, double limit = std::numeric_limits<double>::infinity()) const;

  /// The nearest point of the surface; `point` itself for an empty mesh.
  Eigen::Vector3d nearest(const Eigen::Vector3d& point) const;

  /// Whether the open segment between the two points crosses the surface or a lid: where it does not,
  /// it is inside all along or outside all along. The ends may lie on the surface: a share of 1e-6
  /// of the segment is left out at each. A segment within the plane of a triangle does not cross
  /// that triangle.
  bool crosses(const Eigen::Vector3d& a, const Eigen::Vector3d& b) const;

  /// Every place where the segment from a to b crosses the surface or a lid, by ascending share.
  /// From an end outside the body's box the running sum of `change` is the winding number.
  void crossings(const Eigen::Vector3d& a, const Eigen::Vector3d& b, std::vector<Crossing>& found) const;

 private:
  struct Members;
  std::unique_ptr<Members> members_;
};

}  // namespace sinew
