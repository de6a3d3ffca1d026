#include "pipeline/volume_graph.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "pipeline/lattice_interior.h"
#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

void check_mesh(const TriMesh& mesh) {
  if (mesh.triangles.empty()) throw UnusableInput("volume graph: the mesh has no triangles; expected a surface");
  for (std::size_t index = 0; index < mesh.triangles.size(); ++index) {
    for (const int vertex : mesh.triangles[index]) {
      if (vertex >= 0 && vertex < mesh.vertex_count()) continue;
      throw std::invalid_argument("build_volume_graph: triangle " + std::to_string(index) + " names vertex " +
                                  std::to_string(vertex) + "; expected 0 to " +
                                  std::to_string(mesh.vertex_count() - 1));
    }
  }
  for (int vertex = 0; vertex < mesh.vertex_count(); ++vertex) {
    if (mesh.positions.row(vertex).allFinite()) continue;
    throw UnusableInput("volume graph: vertex " + std::to_string(vertex) +
                        " has a coordinate that is not a finite number");
  }
}

std::vector<Edge> surface_edges(const TriMesh& mesh) {
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const auto& triangle : mesh.triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      const int a = triangle[corner], b = triangle[(corner + 1) % 3];
      if (a != b) edges.push_back({a, b, 1.0});
    }
  }
  return edges;
}

/// Appends the interior to the surface's own nodes and edges.
void join(const TriMesh& mesh, InteriorNodes interior, VolumeGraph& volume) {
  std::vector<Edge> edges = surface_edges(mesh);
  edges.insert(edges.end(), interior.edges.begin(), interior.edges.end());
  interior.edges = {};
  volume.surface_count = mesh.vertex_count();
  volume.rest_positions.resize(mesh.vertex_count() + interior.positions.rows(), 3);
  volume.rest_positions << mesh.positions, interior.positions;
  volume.graph = make_graph(static_cast<int>(volume.rest_positions.rows()), edges);
}

}  // namespace

VolumeGraph build_volume_graph(const TriMesh& mesh, const Solid& solid, const VolumeGraphOptions& options,
                               ThreadTeam& team) {
  check_mesh(mesh);
  VolumeGraph volume;
  InteriorNodes interior;
  if (options.interior != Interior::none) {
    volume.spacing = lattice_spacing(mesh, solid, options, team);
    interior = fill_with_lattice(mesh, solid, volume.spacing, team);
    volume.interior = Interior::lattice;
    if (interior.positions.rows() == 0) {
      volume.warnings.push_back("W_NO_INTERIOR: no lattice node fits inside the surface; a smaller spacing may help");
    }
  }
  join(mesh, std::move(interior), volume);
  return volume;
}

}  // namespace sinew
