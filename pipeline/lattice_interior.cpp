#include "pipeline/lattice_interior.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include "skeleton/unusable_input.h"

// Volume graph after [Zhou et al. 2005], section 3: inner shell and lattice, here the lattice alone.

namespace sinew {
namespace {

using Eigen::Vector3d;

/// In lattice constants. The nearest of the 14 neighbors are sqrt(3)/2 away, the others 1.
constexpr double kNearestNeighbor = 0.8660254037844386;

/// Nodes nearer to the surface than this share of the spacing nearly coincide with its vertices, and
/// their short edges would make the system stiff; a larger share would empty thin limbs.
constexpr double kClearance = 0.3;

/// Links of a surface vertex, and how far they reach, in spacings. A lattice node with its clearance
/// is at most 1.42 spacings below a flat surface; the far reach is for corners and is tried last.
constexpr int kLinksPerVertex = 4;
constexpr double kReach = 1.6 * kNearestNeighbor;
constexpr double kFarReach = 2.5;

/// Without a spacing or density asked for: how far apart the nearest neighbors are, in mean surface
/// edges, and the most nodes a surface vertex. Finer does not deform better, coarser breaks wrists; where
/// a surface is so dense that this gives very many nodes, limbs are many nodes thick anyway.
constexpr double kDefaultEdges = 1.25;
constexpr double kMostDensity = 5.0;

/// Sine of the least angle between a link and the surface it leaves. More than the angle by which the
/// triangles round a vertex fall away from their mean plane on any but the coarsest round limb:
/// a flatter link could run outside, which matters where another limb is.
constexpr double kSteepness = 0.25;

/// How far in front of a vertex and behind it we look for the inside, in spacings.
constexpr double kProbe = 1e-3;

/// A lattice laid over a box. Nodes sit at whole numbers of half spacings, all three even or all
/// three odd; (x, y) names a column along the box's longest side, z the place in the column.
struct Lattice {
  Vector3d origin = Vector3d::Zero();
  double spacing = 0.0;
  std::array<int, 3> axes = {0, 1, 2};  ///< mesh axis of x, y and z
  std::array<int, 3> size = {0, 0, 0};  ///< half spacings along x, y and z

  Vector3d position(int x, int y, double z) const {
    Vector3d point = origin;
    point[axes[0]] += x * spacing / 2.0;
    point[axes[1]] += y * spacing / 2.0;
    point[axes[2]] += z * spacing / 2.0;
    return point;
  }
};

/// Half spacings that fit into each side of the box, before they are anyone's int.
Vector3d half_spacings(const BoundingBox& box, double spacing) {
  return (box.high - box.low) * (2.0 / spacing);
}

Lattice lay_lattice(const BoundingBox& box, double spacing) {
  Lattice lattice;
  lattice.spacing = spacing;
  const Vector3d extent = box.high - box.low;
  int longest = 0;
  extent.maxCoeff(&longest);
  lattice.axes = {(longest + 1) % 3, (longest + 2) % 3, longest};
  // Odd fractions keep columns off the edges and vertices of surfaces that were modelled on a grid.
  lattice.origin = box.low + spacing / 2.0 * Vector3d(0.2113, 0.4371, 0.3247);
  const Vector3d steps = half_spacings(box, spacing);
  for (int k = 0; k < 3; ++k) lattice.size[k] = static_cast<int>(steps[lattice.axes[k]]) + 1;
  return lattice;
}

struct LatticeNode {
  int z = 0;
  double depth = 0.0;  ///< distance to the surface, or the limit up to which it was asked
};

/// Nodes of a lattice that were kept, column by column, ascending z within each.
struct LatticeNodes {
  std::vector<int> column_start;  ///< x * size[1] + y; one more entry at the end
  std::vector<LatticeNode> nodes;

  /// Index of the node at (x, y, z), -1 when it was not kept.
  int find(const Lattice& lattice, int x, int y, int z) const {
    if (x < 0 || y < 0 || x >= lattice.size[0] || y >= lattice.size[1]) return -1;
    const std::size_t column = static_cast<std::size_t>(x) * lattice.size[1] + y;
    const auto end = nodes.begin() + column_start[column + 1];
    const auto place = std::lower_bound(nodes.begin() + column_start[column], end, z,
                                        [](const LatticeNode& node, int wanted) { return node.z < wanted; });
    return place != end && place->z == z ? static_cast<int>(place - nodes.begin()) : -1;
  }
};

/// The winding number while one walks up a column, in all and of each component.
class ColumnWinding {
 public:
  void pass(const Crossing& crossing) {
    if (crossing.component >= static_cast<int>(of_component_.size()))
      of_component_.resize(crossing.component + 1, 0);
    int& winding = of_component_[crossing.component];
    overlapping_ -= std::abs(winding) > 1;
    winding += crossing.change;
    overlapping_ += std::abs(winding) > 1;
    total_ += crossing.change;
  }
  void undo(const std::vector<Crossing>& crossings) {
    for (Crossing crossing : crossings) {
      crossing.change = -crossing.change;
      pass(crossing);
    }
  }
  /// Inside, and no component covers the place twice. A body within another (an eye) is no overlap.
  bool inside() const { return total_ != 0 && overlapping_ == 0; }

 private:
  std::vector<int> of_component_;
  int total_ = 0;
  int overlapping_ = 0;  ///< components that cover the place more than once
};

/// Scratch memory of a thread that scans columns.
struct ColumnScratch {
  std::vector<Crossing> crossings;
  ColumnWinding winding;
  std::vector<int> inside;  ///< z of the nodes found inside
};

/// Fills scratch.inside with the column's nodes inside. One ray tells them all; where it met a crack
/// (the winding number does not come back to 0) each node is asked for by itself.
void scan_column(const Lattice& lattice, const Solid& solid, int x, int y, ColumnScratch& scratch) {
  scratch.inside.clear();
  const double below = -1.0;
  const double above = lattice.size[2] + 1.0;
  solid.crossings(lattice.position(x, y, below), lattice.position(x, y, above), scratch.crossings);
  if (scratch.crossings.empty()) return;
  int total = 0;
  for (const Crossing& crossing : scratch.crossings) total += crossing.change;
  std::size_t next = 0;
  for (int z = x % 2; z < lattice.size[2]; z += 2) {
    if (total != 0) {
      if (solid.contains(lattice.position(x, y, z))) scratch.inside.push_back(z);
      continue;
    }
    const double share = (z - below) / (above - below);
    while (next < scratch.crossings.size() && scratch.crossings[next].share < share) {
      scratch.winding.pass(scratch.crossings[next++]);
    }
    if (scratch.winding.inside()) scratch.inside.push_back(z);
  }
  scratch.crossings.resize(next);
  scratch.winding.undo(scratch.crossings);
}

struct LatticeRow {
  std::vector<int> column_ends;  ///< of each y, into nodes
  std::vector<LatticeNode> nodes;
};

/// Nodes inside and at least `clearance` from the surface; depths are measured up to `depth_limit`.
LatticeNodes scan_lattice(const Lattice& lattice, const Solid& solid, double clearance, double depth_limit,
                          ThreadTeam& team) {
  std::vector<LatticeRow> rows(lattice.size[0]);
  team.for_each_block(lattice.size[0], [&](int x) {
    thread_local ColumnScratch scratch;
    LatticeRow& row = rows[x];
    row.column_ends.resize(lattice.size[1]);
    for (int y = 0; y < lattice.size[1]; ++y) {
      if (x % 2 == y % 2) {
        scan_column(lattice, solid, x, y, scratch);
        for (const int z : scratch.inside) {
          const double depth = solid.distance(lattice.position(x, y, z), depth_limit);
          if (depth >= clearance) row.nodes.push_back({z, depth});
        }
      }
      row.column_ends[y] = static_cast<int>(row.nodes.size());
    }
  });
  LatticeNodes kept;
  kept.column_start.reserve(static_cast<std::size_t>(lattice.size[0]) * lattice.size[1] + 1);
  kept.column_start.push_back(0);
  for (LatticeRow& row : rows) {
    const int start = static_cast<int>(kept.nodes.size());
    for (const int end : row.column_ends) kept.column_start.push_back(start + end);
    kept.nodes.insert(kept.nodes.end(), row.nodes.begin(), row.nodes.end());
    row = {};
  }
  return kept;
}

/// In order; empties the parts.
std::vector<Edge> concatenate(std::vector<std::vector<Edge>>& parts) {
  std::size_t count = 0;
  for (const std::vector<Edge>& part : parts) count += part.size();
  std::vector<Edge> edges;
  edges.reserve(count);
  for (std::vector<Edge>& part : parts) {
    edges.insert(edges.end(), part.begin(), part.end());
    part = {};
  }
  return edges;
}

/// One half of the 14 neighbors: every edge from the node that comes first in scan order.
constexpr std::array<std::array<int, 3>, 7> kForwardNeighbors = {
    {{0, 0, 2}, {0, 2, 0}, {2, 0, 0}, {1, -1, -1}, {1, -1, 1}, {1, 1, -1}, {1, 1, 1}}};

/// Edges between lattice nodes, numbered from `first_node`; those that cross the surface are dropped.
std::vector<Edge> join_lattice(const Lattice& lattice, const LatticeNodes& kept, const Solid& solid,
                               int first_node, ThreadTeam& team) {
  std::vector<std::vector<Edge>> rows(lattice.size[0]);
  team.for_each_block(lattice.size[0], [&](int x) {
    for (int y = x % 2; y < lattice.size[1]; y += 2) {
      const std::size_t column = static_cast<std::size_t>(x) * lattice.size[1] + y;
      for (int node = kept.column_start[column]; node < kept.column_start[column + 1]; ++node) {
        const int z = kept.nodes[node].z;
        for (const auto& [dx, dy, dz] : kForwardNeighbors) {
          const int other = kept.find(lattice, x + dx, y + dy, z + dz);
          if (other < 0) continue;
          // No surface lies within `depth` of a node, so where the two balls meet none lies between.
          // Lids over holes may: depths do not know them.
          const double length = (dx == 1 ? kNearestNeighbor : 1.0) * lattice.spacing;
          const bool clear = solid.closed() && kept.nodes[node].depth + kept.nodes[other].depth > length;
          if (!clear && solid.crosses(lattice.position(x, y, z), lattice.position(x + dx, y + dy, z + dz)))
            continue;
          rows[x].push_back({first_node + node, first_node + other, 1.0});
        }
      }
    }
  });
  return concatenate(rows);
}

/// Normals at vertices, each triangle weighted by its angle there, so that the result does not depend
/// on how the surface was cut into triangles. They point outward, zero at vertices without triangles.
std::vector<Vector3d> vertex_normals(const TriMesh& mesh) {
  std::vector<Vector3d> normals(mesh.vertex_count(), Vector3d::Zero());
  for (const auto& triangle : mesh.triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      const Vector3d at = mesh.positions.row(triangle[corner]);
      const Vector3d a = Vector3d(mesh.positions.row(triangle[(corner + 1) % 3])) - at;
      const Vector3d b = Vector3d(mesh.positions.row(triangle[(corner + 2) % 3])) - at;
      const Vector3d cross = a.cross(b);
      const double sine = cross.norm();
      if (sine > 0.0) normals[triangle[corner]] += std::atan2(sine, a.dot(b)) / sine * cross;
    }
  }
  const double outward = enclosed_volume(mesh, mesh.positions) < 0.0 ? -1.0 : 1.0;
  for (Vector3d& normal : normals) {
    if (normal.squaredNorm() > 0.0) normal = outward * normal.normalized();
  }
  return normals;
}

/// Joins surface vertices to the lattice below them, or to the opposite side of a thin part.
class SurfaceLinker {
 public:
  SurfaceLinker(const TriMesh& mesh, const Solid& solid, const Lattice& lattice, const LatticeNodes& kept)
      : mesh_(mesh), solid_(solid), lattice_(lattice), kept_(kept), normals_(vertex_normals(mesh)) {}

  void link(int vertex, std::vector<Edge>& edges) const {
    const Vector3d normal = normals_[vertex];
    if (normal.isZero(0.0)) return;
    const Vector3d from = mesh_.positions.row(vertex);
    if (link_below(vertex, from, normal, kReach, kLinksPerVertex, edges)) return;

    // Nothing near below: a corner, a thin part, a patch turned inside out, or another limb's inside.
    const bool inside_below = solid_.contains(from - kProbe * lattice_.spacing * normal);
    const bool inside_above = solid_.contains(from + kProbe * lattice_.spacing * normal);
    if (inside_below == inside_above) return;
    const Vector3d outward = inside_below ? normal : Vector3d(-normal);
    if (link_across(vertex, from, outward, edges)) return;
    link_below(vertex, from, outward, kFarReach, 1, edges);
  }

 private:
  struct Candidate {
    double distance = 0.0;
    int node = 0;
    Vector3d position;
  };

  /// Links to at most `wanted` of the nearest nodes within `reach` spacings to which the way is inside.
  bool link_below(int vertex, const Vector3d& from, const Vector3d& outward, double reach, int wanted,
                  std::vector<Edge>& edges) const {
    thread_local std::vector<Candidate> candidates;
    find_candidates(from, outward, reach * lattice_.spacing, candidates);
    int found = 0;
    for (const Candidate& candidate : candidates) {
      // A way that starts inside, at the node, and crosses nothing is inside up to the vertex.
      if (solid_.crosses(candidate.position, from)) continue;
      edges.push_back({vertex, mesh_.vertex_count() + candidate.node, 1.0});
      if (++found == wanted) break;
    }
    return found > 0;
  }

  /// Nodes within `radius` on the inner side of the vertex's own surface, nearest first. Where limbs
  /// overlap, nodes on the outer side belong to the other limb.
  void find_candidates(const Vector3d& from, const Vector3d& outward, double radius,
                       std::vector<Candidate>& candidates) const {
    candidates.clear();
    const double half = lattice_.spacing / 2.0;
    std::array<double, 3> center = {};
    for (int k = 0; k < 3; ++k)
      center[k] = (from[lattice_.axes[k]] - lattice_.origin[lattice_.axes[k]]) / half;
    const double span = radius / half;
    const auto first = [&](int k) { return static_cast<int>(std::ceil(center[k] - span)); };
    const auto last = [&](int k) { return static_cast<int>(std::floor(center[k] + span)); };
    for (int x = std::max(first(0), 0); x <= std::min(last(0), lattice_.size[0] - 1); ++x) {
      for (int y = std::max(first(1), 0); y <= std::min(last(1), lattice_.size[1] - 1); ++y) {
        if (x % 2 != y % 2) continue;
        const double sideways = (x - center[0]) * (x - center[0]) + (y - center[1]) * (y - center[1]);
        if (sideways > span * span) continue;
        const double upright = std::sqrt(span * span - sideways);
        const std::size_t column = static_cast<std::size_t>(x) * lattice_.size[1] + y;
        const auto end = kept_.nodes.begin() + kept_.column_start[column + 1];
        auto node =
            std::lower_bound(kept_.nodes.begin() + kept_.column_start[column], end, center[2] - upright,
                             [](const LatticeNode& a, double z) { return a.z < z; });
        for (; node != end && node->z <= center[2] + upright; ++node) {
          const Vector3d position = lattice_.position(x, y, node->z);
          const double distance = (position - from).norm();
          if ((position - from).dot(outward) > -kSteepness * distance) continue;
          candidates.push_back({distance, static_cast<int>(node - kept_.nodes.begin()), position});
        }
      }
    }
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
      return a.distance < b.distance || (a.distance == b.distance && a.node < b.node);
    });
  }

  /// Links to a corner of the triangle that the inward normal meets first.
  bool link_across(int vertex, const Vector3d& from, const Vector3d& outward,
                   std::vector<Edge>& edges) const {
    thread_local std::vector<Crossing> crossings;
    const Vector3d to = from - kFarReach * lattice_.spacing * outward;
    solid_.crossings(from, to, crossings);
    for (const Crossing& crossing : crossings) {
      if (crossing.share * kFarReach < kProbe) continue;  // the vertex's own triangles
      if (crossing.triangle < 0) return false;            // the body is open there
      const Vector3d hit = from + crossing.share * (to - from);
      const Vector3d beyond = hit - kProbe * lattice_.spacing * outward;
      // Still inside: that is another limb's surface, which reaches into this one.
      return !solid_.contains(beyond) && link_to_corner(vertex, from, hit, crossing.triangle, edges);
    }
    return false;
  }

  bool link_to_corner(int vertex, const Vector3d& from, const Vector3d& hit, int triangle,
                      std::vector<Edge>& edges) const {
    std::array<int, 3> corners = mesh_.triangles[triangle];
    std::sort(corners.begin(), corners.end(), [&](int a, int b) {
      const double to_a = (Vector3d(mesh_.positions.row(a)) - hit).squaredNorm();
      const double to_b = (Vector3d(mesh_.positions.row(b)) - hit).squaredNorm();
      return to_a < to_b || (to_a == to_b && a < b);
    });
    for (const int corner : corners) {
      const Vector3d to = mesh_.positions.row(corner);
      if (corner == vertex || solid_.crosses(from, to) || !solid_.contains((from + to) / 2.0)) continue;
      edges.push_back({vertex, corner, 1.0});
      return true;
    }
    return false;
  }

  const TriMesh& mesh_;
  const Solid& solid_;
  const Lattice& lattice_;
  const LatticeNodes& kept_;
  std::vector<Vector3d> normals_;
};

std::vector<Edge> link_surface(const SurfaceLinker& linker, int vertex_count, ThreadTeam& team) {
  constexpr int kBlock = 1024;
  const int block_count = (vertex_count + kBlock - 1) / kBlock;
  std::vector<std::vector<Edge>> blocks(block_count);
  team.for_each_block(block_count, [&](int block) {
    const int end = std::min(vertex_count, (block + 1) * kBlock);
    for (int vertex = block * kBlock; vertex < end; ++vertex) linker.link(vertex, blocks[block]);
  });
  return concatenate(blocks);
}

/// Whether edges lead from each interior node to some surface vertex.
std::vector<char> reached_from_surface(int surface_count, int interior_count,
                                       const std::vector<Edge>& edges) {
  std::vector<int> parent(surface_count + interior_count);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&parent](int node) {
    while (parent[node] != node) node = parent[node] = parent[parent[node]];
    return node;
  };
  for (const Edge& edge : edges) {
    const int a = root(edge.a), b = root(edge.b);
    parent[std::max(a, b)] = std::min(a, b);  // the smallest node is the root: surface vertices come first
  }
  std::vector<char> reached(interior_count);
  for (int node = 0; node < interior_count; ++node)
    reached[node] = root(surface_count + node) < surface_count;
  return reached;
}

/// Drops interior nodes that are not reached, with their edges, and closes the gaps in the numbering.
void drop_unreached(InteriorNodes& interior, const std::vector<char>& reached, int surface_count) {
  std::vector<int> new_number(reached.size(), -1);
  int count = 0;
  for (std::size_t node = 0; node < reached.size(); ++node) {
    if (!reached[node]) continue;
    interior.positions.row(count) = interior.positions.row(static_cast<Eigen::Index>(node));
    new_number[node] = count++;
  }
  if (count == static_cast<int>(reached.size())) return;
  interior.positions.conservativeResize(count, 3);
  const auto renumber = [&](int& node) {
    if (node >= surface_count) node = surface_count + new_number[node - surface_count];
  };
  // The ends of an edge are either both reached or both not.
  std::erase_if(interior.edges, [&](const Edge& edge) {
    const int node = std::max(edge.a, edge.b);
    return node >= surface_count && !reached[node - surface_count];
  });
  for (Edge& edge : interior.edges) {
    renumber(edge.a);
    renumber(edge.b);
  }
}

Field3 node_positions(const Lattice& lattice, const LatticeNodes& kept) {
  Field3 positions(static_cast<Eigen::Index>(kept.nodes.size()), 3);
  for (int x = 0; x < lattice.size[0]; ++x) {
    for (int y = 0; y < lattice.size[1]; ++y) {
      const std::size_t column = static_cast<std::size_t>(x) * lattice.size[1] + y;
      for (int node = kept.column_start[column]; node < kept.column_start[column + 1]; ++node) {
        positions.row(node) = lattice.position(x, y, kept.nodes[node].z).transpose();
      }
    }
  }
  return positions;
}

/// The inside, sampled by a coarse lattice: how deep each sample lies and what volume it stands for.
struct InsideSamples {
  std::vector<double> depths;
  double volume_each = 0.0;

  double volume() const { return volume_each * static_cast<double>(depths.size()); }
  /// Lattice nodes to be expected at a spacing: two a cube, less those too near the surface.
  double node_count(double spacing) const {
    const auto deep = std::count_if(depths.begin(), depths.end(),
                                    [&](double depth) { return depth >= kClearance * spacing; });
    return 2.0 * volume_each * static_cast<double>(deep) / (spacing * spacing * spacing);
  }
};

InsideSamples sample_inside(const BoundingBox& box, const Solid& solid, ThreadTeam& team) {
  constexpr double kSamplesInBox = 100'000;  // a tenth or more falls inside: counts good to 2 %
  const double box_volume = (box.high - box.low).prod();
  const double spacing = std::cbrt(2.0 * box_volume / kSamplesInBox);
  InsideSamples samples;
  if (!(spacing > 0.0)) return samples;
  samples.volume_each = spacing * spacing * spacing / 2.0;
  const LatticeNodes inside =
      scan_lattice(lay_lattice(box, spacing), solid, 0.0, std::numeric_limits<double>::infinity(), team);
  for (const LatticeNode& node : inside.nodes) samples.depths.push_back(node.depth);
  return samples;
}

/// Spacing at which about `density` nodes a surface vertex fit inside; 0 when nothing is inside.
double spacing_for_density(const TriMesh& mesh, const Solid& solid, double density, ThreadTeam& team) {
  const InsideSamples samples = sample_inside(bounds(mesh), solid, team);
  const double wanted = density * mesh.vertex_count();
  // Without its clearance the lattice would hold more nodes, so this spacing is too wide or just right.
  double wide = std::cbrt(2.0 * samples.volume() / wanted);
  double narrow = wide / 16.0;
  for (int step = 0; step < 50; ++step) {
    const double middle = std::sqrt(narrow * wide);
    (samples.node_count(middle) > wanted ? narrow : wide) = middle;
  }
  return wide;
}

double default_spacing(const TriMesh& mesh, const Solid& solid, ThreadTeam& team) {
  const double spacing = kDefaultEdges * mean_edge_length(mesh) / kNearestNeighbor;
  const double most_nodes =
      2.0 * std::abs(enclosed_volume(mesh, mesh.positions)) / (spacing * spacing * spacing);
  if (!(most_nodes > kMostDensity * mesh.vertex_count())) return spacing;
  return std::max(spacing, spacing_for_density(mesh, solid, kMostDensity, team));
}

void check_option(const char* name, double value) {
  if (value >= 0.0 && std::isfinite(value)) return;
  throw std::invalid_argument("build_volume_graph: " + std::string(name) + " is " + std::to_string(value) +
                              "; expected 0 or a positive number");
}

std::string short_number(double value) {
  std::array<char, 32> text = {};
  std::snprintf(text.data(), text.size(), "%.4g", value);
  return text.data();
}

/// Refuses before memory is touched. The box holds at most this many nodes, the inside fewer.
void check_node_count(const BoundingBox& box, const Solid& solid, double spacing, int max_nodes,
                      ThreadTeam& team) {
  const Eigen::Array3d steps = half_spacings(box, spacing).array() + 1.0;
  const double columns = steps.prod() / steps.maxCoeff();
  const double scan = std::max(columns, steps.maxCoeff());  // what a scan needs even if it finds nothing
  double expected = std::max(steps.prod() / 4.0, scan);
  if (expected > max_nodes) expected = std::max(sample_inside(box, solid, team).node_count(spacing), scan);
  if (expected <= max_nodes) return;
  throw UnusableInput("volume graph: a lattice spacing of " + short_number(spacing) + " would need about " +
                      short_number(expected) + " interior nodes, more than the limit of " +
                      std::to_string(max_nodes) + "; ask for a larger spacing or a lower density");
}

}  // namespace

double lattice_spacing(const TriMesh& mesh, const Solid& solid, const VolumeGraphOptions& options,
                       ThreadTeam& team) {
  check_option("spacing", options.spacing);
  check_option("density", options.density);
  double spacing = options.spacing;
  if (spacing == 0.0 && options.density > 0.0)
    spacing = spacing_for_density(mesh, solid, options.density, team);
  if (spacing == 0.0) spacing = default_spacing(mesh, solid, team);
  if (!(spacing > 0.0)) {
    throw UnusableInput("volume graph: all triangles of the mesh are single points; expected a surface");
  }
  check_node_count(bounds(mesh), solid, spacing, options.max_nodes, team);
  return spacing;
}

InteriorNodes fill_with_lattice(const TriMesh& mesh, const Solid& solid, double spacing, ThreadTeam& team) {
  const Lattice lattice = lay_lattice(bounds(mesh), spacing);
  // A node as deep as the longest edge is long has no edge that could cross the surface.
  const LatticeNodes kept = scan_lattice(lattice, solid, kClearance * spacing, spacing, team);
  InteriorNodes interior;
  interior.positions = node_positions(lattice, kept);
  interior.edges = join_lattice(lattice, kept, solid, mesh.vertex_count(), team);
  const SurfaceLinker linker(mesh, solid, lattice, kept);
  const std::vector<Edge> links = link_surface(linker, mesh.vertex_count(), team);
  interior.edges.insert(interior.edges.end(), links.begin(), links.end());
  const int interior_count = static_cast<int>(kept.nodes.size());
  const auto reached = reached_from_surface(mesh.vertex_count(), interior_count, interior.edges);
  drop_unreached(interior, reached, mesh.vertex_count());
  return interior;
}

}  // namespace sinew
