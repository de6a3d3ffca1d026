#include "pipeline/volume_graph.h"

#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>

#include "pipeline/lattice_interior.h"
#include "pipeline/tetgen_interior.h"
#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

void check_mesh(const TriMesh& mesh) {
  if (mesh.triangles.empty())
    throw UnusableInput("volume graph: the mesh has no triangles; expected a surface");
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

/// Puts the interior behind the surface's own nodes and edges.
void join(const TriMesh& mesh, InteriorNodes interior, VolumeGraph& volume) {
  std::vector<Edge> edges = surface_edges(mesh);
  edges.reserve(edges.size() + interior.edges.size());
  edges.insert(edges.end(), interior.edges.begin(), interior.edges.end());
  interior.edges = {};
  volume.surface_count = mesh.vertex_count();
  volume.rest_positions.resize(mesh.vertex_count() + interior.positions.rows(), 3);
  volume.rest_positions << mesh.positions, interior.positions;
  volume.graph = make_graph(static_cast<int>(volume.rest_positions.rows()), edges);
}

double mean_interior_edge(const VolumeGraph& volume) {
  double sum = 0.0;
  std::int64_t count = 0;
  for (int node = volume.surface_count; node < volume.node_count(); ++node) {
    for (const int neighbor : volume.graph.neighbors_of(node)) {
      sum += (volume.rest_positions.row(node) - volume.rest_positions.row(neighbor)).norm();
      ++count;
    }
  }
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

/// Tetrahedra if they can be had; false, and one warning, if not.
bool fill_by_worker(const TriMesh& mesh, const Solid& solid, double spacing,
                    const VolumeGraphOptions& options, VolumeGraph& volume) {
  try {
    join(mesh, fill_with_tetrahedra(mesh, solid, spacing, options), volume);
  } catch (const TetgenFailure& failure) {
    volume.warnings.push_back("W_TETGEN_FALLBACK: the tetrahedra worker " + std::string(failure.what()) +
                              "; the lattice fills the body instead");
    return false;
  }
  volume.interior = Interior::tetgen;
  volume.spacing = mean_interior_edge(volume);
  return true;
}

void fill_by_lattice(const TriMesh& mesh, const Solid& solid, double spacing, ThreadTeam& team,
                     VolumeGraph& volume) {
  join(mesh, fill_with_lattice(mesh, solid, spacing, team), volume);
  volume.interior = Interior::lattice;
  volume.spacing = spacing;
  if (volume.node_count() > volume.surface_count) return;
  volume.warnings.push_back(
      "W_NO_INTERIOR: no lattice node fits inside the surface; a smaller spacing may help");
}

}  // namespace

VolumeGraph build_volume_graph(const TriMesh& mesh, const Solid& solid, const VolumeGraphOptions& options,
                               ThreadTeam& team) {
  check_mesh(mesh);
  VolumeGraph volume;
  if (options.interior == Interior::none) {
    join(mesh, {}, volume);
    return volume;
  }
  const double spacing = lattice_spacing(mesh, solid, options, team);
  const bool filled =
      options.interior == Interior::tetgen && fill_by_worker(mesh, solid, spacing, options, volume);
  if (!filled) fill_by_lattice(mesh, solid, spacing, team, volume);
  return volume;
}

}  // namespace sinew
