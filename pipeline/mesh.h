#pragma once

#include <array>
#include <vector>

#include "solver/field.h"

namespace sinew {

/// The surface that is solved: rest positions and triangles, welded, no adjacency. Triangles may
/// be open, non-manifold or self-intersecting: nothing downstream relies on a closed surface.
struct TriMesh {
  Field3 positions;                          ///< vertex_count x 3, mesh space
  std::vector<std::array<int, 3>> triangles;  ///< counter-clockwise seen from outside

  int vertex_count() const { return static_cast<int>(positions.rows()); }
};

struct BoundingBox {
  Eigen::Vector3d low = Eigen::Vector3d::Zero();
  Eigen::Vector3d high = Eigen::Vector3d::Zero();
  double diagonal() const { return (high - low).norm(); }
};
/// Of all vertices that a triangle uses; all zero when there is none.
BoundingBox bounds(const TriMesh& mesh);

/// Signed volume enclosed by the triangles (divergence theorem), for `positions` in place of the
/// rest ones. Exact for closed meshes; for open ones still a smooth measure of change when positions
/// are taken relative to a point inside.
double enclosed_volume(const TriMesh& mesh, const Eigen::Ref<const Field3>& positions);

/// Mean length of the triangles' edges.
double mean_edge_length(const TriMesh& mesh);

}  // namespace sinew
