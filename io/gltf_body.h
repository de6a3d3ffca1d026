#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <string>
#include <vector>

#include "io/gltf_bind.h"
#include "io/gltf_document.h"
#include "io/mesh_asset.h"

namespace sinew {

/// A primitive as the scene draws it: the same mesh under two nodes is two parts.
struct GltfPart {
  int node = 0;
  int skin = -1;  ///< -1: rigid, placed by its node
  int mesh = 0;
  int primitive = 0;                 ///< of that mesh
  std::vector<double> positions;     ///< 3 a vertex, in the mesh's own space
  int influences = 0;                ///< a vertex; 0 when rigid
  std::vector<std::uint32_t> slots;  ///< `influences` a vertex: entries of the skin's joints
  std::vector<double> weights;       ///< alongside; sum 1 a vertex

  int vertex_count() const { return static_cast<int>(positions.size() / 3); }
};

/// Everything the scene draws with triangles.
struct GltfBody {
  std::vector<GltfPart> parts;
  std::vector<std::string> warnings;
};

/// Throws FileError: malformed for weights or joints out of range, resource when the scene repeats its
/// meshes into more vertices than 32-bit indices and a stated amount of memory hold.
GltfBody read_gltf_body(const GltfDocument& document);

/// Per vertex of `part`, the matrix that takes it from mesh space to the scene when the nodes stand at
/// `world`: linear blend skinning, or the node's own matrix. Calls use(vertex, matrix) for each.
template <class Use>
void for_each_vertex_matrix(const GltfPart& part, const GltfDocument& document, const GltfBind& bind,
                            const std::vector<Eigen::Affine3d>& world, Use use) {
  if (part.skin < 0) {
    for (int vertex = 0; vertex < part.vertex_count(); ++vertex) use(vertex, world[part.node]);
    return;
  }
  const std::vector<int>& joints = document.skins[part.skin].joints;
  std::vector<Eigen::Affine3d> of_slot(joints.size());
  for (std::size_t slot = 0; slot < joints.size(); ++slot) {
    of_slot[slot] = world[joints[slot]] * bind.inverse_bind[part.skin][slot];
  }
  Eigen::Affine3d blended;
  for (int vertex = 0; vertex < part.vertex_count(); ++vertex) {
    blended.matrix().setZero();
    for (int i = vertex * part.influences; i < (vertex + 1) * part.influences; ++i) {
      if (part.weights[i] > 0.0) blended.matrix() += part.weights[i] * of_slot[part.slots[i]].matrix();
    }
    blended.makeAffine();
    use(vertex, blended);
  }
}

/// All parts' vertices, one below the other, with the nodes at `world`.
Field3 place_vertices(const GltfBody& body, const GltfDocument& document, const GltfBind& bind,
                      const std::vector<Eigen::Affine3d>& world);

/// The body at bind as a mesh asset: positions, triangles, attributes and appearance, not yet welded.
MeshAsset bind_mesh(const GltfBody& body, const GltfDocument& document, const GltfBind& bind);

}  // namespace sinew
