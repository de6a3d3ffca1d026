#include "io/mesh_asset.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <stdexcept>
#include <string>

#include "io/file_error.h"

namespace sinew {
namespace {

/// A triangle whose height is a smaller share of its longest side has no area: far above the rounding
/// of a cross product, far below what a file can mean.
constexpr double kFlat = 1e-12;

/// Finds, for one point after another, an earlier one within `radius`; a grid whose cells are a few
/// radii wide, so that most points look into one cell and none into more than eight.
class PointGrid {
 public:
  /// `low` below all points; room for `capacity` of them.
  PointGrid(const Eigen::RowVector3d& low, double radius, std::size_t capacity)
      : low_(low), radius_(radius), cell_size_(4 * radius) {
    std::size_t buckets = 16;
    while (buckets < 2 * capacity) buckets *= 2;
    first_.assign(buckets, -1);
  }

  /// Number of the lowest earlier point within radius, or of this one, now stored.
  int find_or_add(const Eigen::RowVector3d& point) {
    const int found = find(point);
    if (found >= 0) return found;
    const int number = static_cast<int>(points_.size());
    int& first = first_[bucket(cell_of(point))];
    points_.push_back(point);
    next_.push_back(first);
    first = number;
    return number;
  }

  const std::vector<Eigen::RowVector3d>& points() const { return points_; }

 private:
  using Cell = Eigen::Matrix<std::int64_t, 1, 3>;

  Cell cell_of(const Eigen::RowVector3d& point) const {
    return ((point - low_) / cell_size_).array().floor().cast<std::int64_t>();
  }

  std::size_t bucket(const Cell& cell) const {
    std::uint64_t hash = 0;
    for (const std::int64_t index : cell) {
      hash = (hash ^ static_cast<std::uint64_t>(index)) * 0x9E3779B97F4A7C15U;  // 2^64 over the golden ratio
      hash ^= hash >> 32;
    }
    return hash & (first_.size() - 1);
  }

  int find(const Eigen::RowVector3d& point) const {
    const Cell low = cell_of(point.array() - radius_);
    const Cell high = cell_of(point.array() + radius_);
    int found = -1;
    for (std::int64_t x = low[0]; x <= high[0]; ++x) {
      for (std::int64_t y = low[1]; y <= high[1]; ++y) {
        for (std::int64_t z = low[2]; z <= high[2]; ++z) found = nearest_in({x, y, z}, point, found);
      }
    }
    return found;
  }

  int nearest_in(const Cell& cell, const Eigen::RowVector3d& point, int best) const {
    for (int i = first_[bucket(cell)]; i >= 0; i = next_[i]) {
      const bool earlier = best < 0 || i < best;
      // Divided first, so that lengths near the ends of the range of doubles square without loss.
      if (earlier && ((points_[i] - point) / radius_).squaredNorm() <= 1.0) best = i;
    }
    return best;
  }

  Eigen::RowVector3d low_;
  double radius_;
  double cell_size_;
  std::vector<int> first_;  // bucket -> its latest point
  std::vector<int> next_;   // point -> the one before it in its bucket
  std::vector<Eigen::RowVector3d> points_;
};

/// All triangles of all primitives, as rows of the source; the triangles' order is the file's.
std::vector<std::array<int, 3>> source_triangles(const MeshAsset& asset) {
  std::vector<std::array<int, 3>> triangles;
  for (const SourcePrimitive& primitive : asset.primitives) {
    for (std::size_t i = 0; i + 2 < primitive.indices.size(); i += 3) {
      std::array<int, 3> triangle;
      for (int corner = 0; corner < 3; ++corner) {
        triangle[corner] = primitive.first_vertex + static_cast<int>(primitive.indices[i + corner]);
      }
      triangles.push_back(triangle);
    }
  }
  return triangles;
}

std::vector<bool> referenced_rows(const std::vector<std::array<int, 3>>& triangles, Eigen::Index rows) {
  std::vector<bool> referenced(rows);
  for (const auto& triangle : triangles) {
    for (const int row : triangle) referenced[row] = true;
  }
  return referenced;
}

[[noreturn]] void refuse(const MeshAsset& asset, const std::string& what) {
  throw FileError(FileFault::unusable, asset.path.string(), what);
}

/// Welds the referenced rows: fills mesh.positions and vertex_of_source. Returns the diagonal.
double weld(MeshAsset& asset, const std::vector<bool>& referenced, double tolerance) {
  const Field3& source = asset.source_positions;
  Eigen::RowVector3d low = Eigen::RowVector3d::Constant(std::numeric_limits<double>::infinity());
  Eigen::RowVector3d high = -low;
  for (Eigen::Index row = 0; row < source.rows(); ++row) {
    if (!referenced[row]) continue;
    low = low.cwiseMin(source.row(row));
    high = high.cwiseMax(source.row(row));
  }
  const double diagonal = (high - low).stableNorm();
  if (!std::isfinite(diagonal)) refuse(asset, "coordinates are too far apart to be measured");
  if (diagonal * tolerance < std::numeric_limits<double>::min()) refuse(asset, "all vertices lie at one point; a mesh needs a surface");

  PointGrid grid(low, tolerance * diagonal, static_cast<std::size_t>(source.rows()));
  asset.vertex_of_source.assign(source.rows(), -1);
  for (Eigen::Index row = 0; row < source.rows(); ++row) {
    if (referenced[row]) asset.vertex_of_source[row] = grid.find_or_add(source.row(row));
  }
  asset.mesh.positions.resize(static_cast<Eigen::Index>(grid.points().size()), 3);
  for (std::size_t vertex = 0; vertex < grid.points().size(); ++vertex) {
    asset.mesh.positions.row(vertex) = grid.points()[vertex];
  }
  return diagonal;
}

bool has_area(const Field3& positions, const std::array<int, 3>& triangle, double diagonal) {
  // In units of the diagonal, so that squares of squares stay in range at any scale.
  const Eigen::RowVector3d a = (positions.row(triangle[1]) - positions.row(triangle[0])) / diagonal;
  const Eigen::RowVector3d b = (positions.row(triangle[2]) - positions.row(triangle[0])) / diagonal;
  const double longest = std::max({a.squaredNorm(), b.squaredNorm(), (b - a).squaredNorm()});
  return a.cross(b).norm() > kFlat * longest;
}

/// Items in buckets: those of bucket i are items[offsets[i]] up to items[offsets[i + 1]].
struct Buckets {
  std::vector<std::int64_t> offsets;
  std::vector<std::array<int, 2>> items;
};

/// Puts (key, item) pairs, which `each` hands to a function, into a bucket for each key.
template <class Each>
Buckets sort_into_buckets(int keys, const Each& each) {
  Buckets buckets;
  buckets.offsets.assign(keys + 1, 0);
  each([&](int key, const std::array<int, 2>&) { ++buckets.offsets[key + 1]; });
  std::partial_sum(buckets.offsets.begin(), buckets.offsets.end(), buckets.offsets.begin());
  buckets.items.resize(buckets.offsets.back());
  std::vector<std::int64_t> place = buckets.offsets;
  each([&](int key, const std::array<int, 2>& item) { buckets.items[place[key]++] = item; });
  for (int key = 0; key < keys; ++key) {
    std::sort(buckets.items.begin() + buckets.offsets[key], buckets.items.begin() + buckets.offsets[key + 1]);
  }
  return buckets;
}

/// Edges by how many triangles run them forth (from the lower vertex to the higher) and back.
void count_edges(const std::vector<std::array<int, 3>>& triangles, int vertex_count, MeshDiagnosis& diagnosis) {
  enum { kForth, kBack };
  const Buckets edges = sort_into_buckets(vertex_count, [&](const auto& put) {
    for (const auto& triangle : triangles) {
      for (int corner = 0; corner < 3; ++corner) {
        const int from = triangle[corner];
        const int to = triangle[(corner + 1) % 3];
        put(std::min(from, to), {std::max(from, to), from < to ? kForth : kBack});
      }
    }
  });
  for (int low = 0; low < vertex_count; ++low) {
    for (std::int64_t i = edges.offsets[low]; i < edges.offsets[low + 1];) {
      std::int64_t runs[2] = {0, 0};
      const int high = edges.items[i][0];
      for (; i < edges.offsets[low + 1] && edges.items[i][0] == high; ++i) ++runs[edges.items[i][1]];
      diagnosis.boundary_edges += runs[kForth] + runs[kBack] == 1;
      diagnosis.non_manifold_edges += runs[kForth] + runs[kBack] > 2;
      diagnosis.inconsistent_edges += (runs[kForth] > 1) + (runs[kBack] > 1);
    }
  }
}

std::int64_t count_duplicates(const std::vector<std::array<int, 3>>& triangles, int vertex_count) {
  const Buckets sorted = sort_into_buckets(vertex_count, [&](const auto& put) {
    for (auto triangle : triangles) {
      std::sort(triangle.begin(), triangle.end());
      put(triangle[0], {triangle[1], triangle[2]});
    }
  });
  std::int64_t duplicates = 0;
  for (int low = 0; low < vertex_count; ++low) {
    for (std::int64_t i = sorted.offsets[low] + 1; i < sorted.offsets[low + 1]; ++i) {
      duplicates += sorted.items[i] == sorted.items[i - 1];
    }
  }
  return duplicates;
}

int count_components(const std::vector<std::array<int, 3>>& triangles, int vertex_count) {
  std::vector<int> parent(vertex_count);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&parent](int vertex) {
    while (parent[vertex] != vertex) vertex = parent[vertex] = parent[parent[vertex]];
    return vertex;
  };
  std::vector<bool> used(vertex_count);
  for (const auto& triangle : triangles) {
    for (const int vertex : triangle) {
      used[vertex] = true;
      const int a = root(triangle[0]);
      const int b = root(vertex);
      parent[std::max(a, b)] = std::min(a, b);  // the lower root stays, whatever the order
    }
  }
  int components = 0;
  for (int vertex = 0; vertex < vertex_count; ++vertex) components += used[vertex] && parent[vertex] == vertex;
  return components;
}

void turn_outward(MeshAsset& asset) {
  MeshDiagnosis& diagnosis = asset.diagnosis;
  // An open sheet encloses nothing, and the sign of what is left says nothing of its outside.
  if (!diagnosis.closed) return;
  diagnosis.outward = enclosed_volume(asset.mesh, asset.mesh.positions) >= 0;
  if (diagnosis.outward) return;
  for (auto& triangle : asset.mesh.triangles) std::swap(triangle[1], triangle[2]);
  asset.warnings.push_back("W_MESH_INWARD: the triangles face inward; turned for solving, kept as they are in what is written");
}

}  // namespace

void weld_and_diagnose(MeshAsset& asset, double tolerance) {
  if (!(tolerance >= 1e-15 && tolerance < 1)) {  // finer, and the grid's cells could not be counted
    throw std::invalid_argument("weld_and_diagnose: tolerance " + std::to_string(tolerance) + "; expected 1e-15 to 1");
  }
  MeshDiagnosis& diagnosis = asset.diagnosis;
  const std::int64_t source_faces = diagnosis.source_faces;
  diagnosis = {};
  std::vector<std::array<int, 3>> triangles = source_triangles(asset);
  diagnosis.source_faces = source_faces;
  diagnosis.source_vertices = asset.source_positions.rows();
  diagnosis.triangles = static_cast<std::int64_t>(triangles.size());
  if (triangles.empty()) refuse(asset, "no triangles; a mesh needs a surface");

  const std::vector<bool> referenced = referenced_rows(triangles, asset.source_positions.rows());
  diagnosis.unreferenced_vertices = std::count(referenced.begin(), referenced.end(), false);
  const double diagonal = weld(asset, referenced, tolerance);
  const int vertex_count = asset.mesh.vertex_count();
  diagnosis.welded_vertices = vertex_count;

  for (auto& triangle : triangles) {
    for (int& row : triangle) row = asset.vertex_of_source[row];
  }
  std::erase_if(triangles, [](const auto& t) { return t[0] == t[1] || t[1] == t[2] || t[2] == t[0]; });
  // A triangle without area that has three corners still joins its neighbours: it counts for how the
  // surface hangs together, and only then goes.
  count_edges(triangles, vertex_count, diagnosis);
  diagnosis.duplicate_triangles = count_duplicates(triangles, vertex_count);
  diagnosis.components = count_components(triangles, vertex_count);
  diagnosis.closed = diagnosis.boundary_edges == 0 && diagnosis.non_manifold_edges == 0;
  std::erase_if(triangles, [&](const auto& t) { return !has_area(asset.mesh.positions, t, diagonal); });
  diagnosis.degenerate_triangles = diagnosis.triangles - static_cast<std::int64_t>(triangles.size());
  asset.mesh.triangles = std::move(triangles);
  if (asset.mesh.triangles.empty()) refuse(asset, "no triangle has an area; a mesh needs a surface");
  turn_outward(asset);
}

}  // namespace sinew
