#include "pipeline/volume_graph.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/lattice_interior.h"
#include "pipeline/tetgen_interior.h"
#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

/// A surface edge is short below this share of the mean length of the surface edges at its ends. A
/// regular triangulation, even one stretched by half, has none.
constexpr double kShortEdge = 0.4;

/// A node with more neighbors than this, the pole of a fan, shares them with none: that would take the
/// square of their number of edges.
constexpr std::size_t kMostShared = 32;

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

double length_of(const Field3& positions, const Edge& edge) {
  return (positions.row(edge.a) - positions.row(edge.b)).norm();
}

/// The surface edges that are short beside their neighbors, both ways round, sorted.
std::vector<std::array<int, 2>> short_edges(const Field3& positions, int surface_count,
                                            const std::vector<Edge>& edges) {
  const auto on_surface = [&](const Edge& edge) { return std::max(edge.a, edge.b) < surface_count; };
  std::vector<double> length(surface_count, 0.0);
  std::vector<int> count(surface_count, 0);
  for (const Edge& edge : edges) {
    if (!on_surface(edge)) continue;
    for (const int vertex : {edge.a, edge.b}) {
      length[vertex] += length_of(positions, edge);
      ++count[vertex];
    }
  }
  std::vector<std::array<int, 2>> found;
  for (const Edge& edge : edges) {
    if (!on_surface(edge)) continue;
    const double mean = (length[edge.a] + length[edge.b]) / (count[edge.a] + count[edge.b]);
    if (length_of(positions, edge) >= kShortEdge * mean) continue;
    found.push_back({edge.a, edge.b});
    found.push_back({edge.b, edge.a});
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  return found;
}

/// Gives the two ends of every short surface edge each other's neighbors.
///
/// With weights all alike an edge resists strain by the square of its length. A short one among long
/// ones gives way first: at a crotch two thighs meet in a seam a few millimeters wide, and all their
/// motion against each other would stretch it. Two nodes with the same neighbors keep their distance
/// wherever those turn alike, and the weights stay alike.
void share_neighbors(const Field3& positions, int surface_count, const Solid& solid,
                     std::vector<Edge>& edges) {
  const std::vector<std::array<int, 2>> shorts = short_edges(positions, surface_count, edges);
  if (shorts.empty()) return;
  std::vector<char> is_end(positions.rows(), 0);
  for (const auto& [vertex, other] : shorts) is_end[vertex] = 1;
  std::vector<std::array<int, 2>> neighbors;
  for (const Edge& edge : edges) {
    if (is_end[edge.a]) neighbors.push_back({edge.a, edge.b});
    if (is_end[edge.b]) neighbors.push_back({edge.b, edge.a});
  }
  std::sort(neighbors.begin(), neighbors.end());
  neighbors.erase(std::unique(neighbors.begin(), neighbors.end()), neighbors.end());
  for (const auto& [vertex, other] : shorts) {
    const auto begin = std::lower_bound(neighbors.begin(), neighbors.end(), std::array{other, 0});
    const auto end = std::lower_bound(begin, neighbors.end(), std::array{other + 1, 0});
    if (static_cast<std::size_t>(end - begin) > kMostShared) continue;
    for (auto next = begin; next != end; ++next) {
      const int neighbor = (*next)[1];
      if (neighbor == vertex) continue;
      // Along the surface the short edge leads there; a way into the body must stay in it.
      const bool inner = neighbor >= surface_count;
      if (inner && solid.crosses(positions.row(neighbor).transpose(), positions.row(vertex).transpose()))
        continue;
      edges.push_back({vertex, neighbor, 1.0});
    }
  }
}

/// Puts the interior behind the surface's own nodes and edges.
void join(const TriMesh& mesh, const Solid& solid, InteriorNodes interior, VolumeGraph& volume) {
  std::vector<Edge> edges = surface_edges(mesh);
  edges.reserve(edges.size() + interior.edges.size());
  edges.insert(edges.end(), interior.edges.begin(), interior.edges.end());
  interior.edges = {};
  volume.surface_count = mesh.vertex_count();
  volume.rest_positions.resize(mesh.vertex_count() + interior.positions.rows(), 3);
  volume.rest_positions << mesh.positions, interior.positions;
  share_neighbors(volume.rest_positions, volume.surface_count, solid, edges);
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
    join(mesh, solid, fill_with_tetrahedra(mesh, solid, spacing, options), volume);
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
  join(mesh, solid, fill_with_lattice(mesh, solid, spacing, team), volume);
  volume.interior = Interior::lattice;
  volume.spacing = spacing;
  if (volume.node_count() > volume.surface_count) return;
  volume.warnings.push_back(
      "W_NO_INTERIOR: no lattice node fits inside the surface; a smaller spacing may help");
}

}  // namespace

Eigen::AlignedBox3d rest_box(const VolumeGraph& volume) {
  Eigen::AlignedBox3d box;
  for (int node = 0; node < volume.node_count(); ++node) box.extend(volume.rest_positions.row(node).transpose());
  return box;
}

double rest_diagonal(const VolumeGraph& volume) {
  if (volume.node_count() == 0) return 1.0;
  const double length = rest_box(volume).diagonal().norm();
  return length > 0.0 ? length : 1.0;
}

VolumeGraph build_volume_graph(const TriMesh& mesh, const Solid& solid, const VolumeGraphOptions& options,
                               ThreadTeam& team) {
  check_mesh(mesh);
  VolumeGraph volume;
  if (options.interior == Interior::none) {
    join(mesh, solid, {}, volume);
    return volume;
  }
  const double spacing = lattice_spacing(mesh, solid, options, team);
  const bool filled =
      options.interior == Interior::tetgen && fill_by_worker(mesh, solid, spacing, options, volume);
  if (!filled) fill_by_lattice(mesh, solid, spacing, team, volume);
  return volume;
}

}  // namespace sinew
