#pragma once

#include <array>
#include <vector>

#include "pipeline/mesh.h"

namespace sinew {

/// Triangles that close every hole of `mesh`: with them each edge is used as often in one direction
/// as in the other. Empty for a closed, consistently turned mesh. Lid triangles name vertices of
/// the mesh or, from vertex_count() up, rows of `middles`.
struct HoleLids {
  std::vector<std::array<int, 3>> triangles;
  std::vector<Eigen::Vector3d> middles;
};

/// Rims are cut into simple loops (no vertex twice), each closed by a fan round its middle, or by one
/// triangle where three edges surround it. O(triangles log triangles).
HoleLids close_holes(const TriMesh& mesh);

}  // namespace sinew
