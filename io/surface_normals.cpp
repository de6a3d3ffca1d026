#include "io/surface_normals.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>

namespace sinew {
namespace {

/// Normals closer than this are one normal; seams of an exporter differ by less, hard edges by more.
constexpr double kSameNormal = 1e-3;

/// Lengths further from 1 than this are put right; the specification asks for unit normals.
constexpr double kUnitSlack = 1e-4;

const VertexAttribute* find_normals(const SourcePrimitive& primitive) {
  for (const VertexAttribute& attribute : primitive.attributes)
    if (attribute.name == "NORMAL" && attribute.components == 3) return &attribute;
  return nullptr;
}

template <typename Integer>
double component(const std::byte* at, double largest) {
  Integer value{};
  std::memcpy(&value, at, sizeof value);
  return std::max(-1.0, static_cast<double>(value) / largest);
}

Eigen::Vector3d read_normal(const VertexAttribute& attribute, int vertex) {
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    const auto index = static_cast<std::size_t>(3 * vertex + axis);
    if (attribute.component_type == 5120)
      normal[axis] = component<std::int8_t>(&attribute.data[index], 127.0);
    if (attribute.component_type == 5122)
      normal[axis] = component<std::int16_t>(&attribute.data[2 * index], 32767.0);
    if (attribute.component_type == 5126) {
      float value = 0.0F;
      std::memcpy(&value, &attribute.data[4 * index], sizeof value);
      normal[axis] = static_cast<double>(value);
    }
  }
  return normal;
}

/// Zero where the source has none.
std::vector<Eigen::Vector3d> normals_of_source(const MeshAsset& asset) {
  std::vector<Eigen::Vector3d> normals(asset.vertex_of_source.size(), Eigen::Vector3d::Zero());
  for (const SourcePrimitive& primitive : asset.primitives) {
    const VertexAttribute* attribute = find_normals(primitive);
    if (attribute == nullptr) continue;
    for (int vertex = 0; vertex < primitive.vertex_count; ++vertex) {
      Eigen::Vector3d normal = read_normal(*attribute, vertex);
      const double length = normal.norm();
      if (!(length > kUnitSlack) || !std::isfinite(length)) continue;
      if (std::abs(length - 1.0) > kUnitSlack) normal /= length;
      normals[static_cast<std::size_t>(primitive.first_vertex + vertex)] = normal;
    }
  }
  return normals;
}

/// `normal` turned by the smallest rotation that takes unit vector `from` to unit vector `to`.
Eigen::Vector3d carried(const Eigen::Vector3d& normal, const Eigen::Vector3d& from,
                        const Eigen::Vector3d& to) {
  const Eigen::Vector3d axis = from.cross(to);
  const double cosine = from.dot(to);
  // Opposite vectors have no smallest turn; the computed normal is the best there is.
  if (cosine < -0.999) return to;
  return (cosine * normal + axis.cross(normal) + axis * (axis.dot(normal) / (1.0 + cosine))).normalized();
}

Eigen::Map<const Eigen::Vector3d> vector_at(std::span<const double> values, int index) {
  return Eigen::Map<const Eigen::Vector3d>(&values[3 * static_cast<std::size_t>(index)]);
}

Eigen::Map<Eigen::Vector3d> vector_at(std::span<double> values, int index) {
  return Eigen::Map<Eigen::Vector3d>(&values[3 * static_cast<std::size_t>(index)]);
}

}  // namespace

SurfaceNormals::SurfaceNormals(const MeshAsset& asset) : group_of_row_(asset.vertex_of_source.size(), -1) {
  const std::vector<Eigen::Vector3d> own = normals_of_source(asset);
  const int vertex_count = asset.mesh.vertex_count();
  std::vector<int> newest_group(static_cast<std::size_t>(vertex_count), -1);  // heads of lists of groups
  std::vector<int> older_group;
  std::vector<Eigen::Vector3d> normal_of_group;
  for (std::size_t row = 0; row < own.size(); ++row) {
    const int vertex = asset.vertex_of_source[row];
    if (vertex < 0) continue;
    int group = newest_group[static_cast<std::size_t>(vertex)];
    while (group >= 0 && (normal_of_group[static_cast<std::size_t>(group)] - own[row]).norm() > kSameNormal)
      group = older_group[static_cast<std::size_t>(group)];
    if (group < 0) {
      group = static_cast<int>(normal_of_group.size());
      normal_of_group.push_back(own[row]);
      older_group.push_back(newest_group[static_cast<std::size_t>(vertex)]);
      newest_group[static_cast<std::size_t>(vertex)] = group;
    }
    group_of_row_[row] = group;
  }
  for (const SourcePrimitive& primitive : asset.primitives) {
    for (std::size_t i = 0; i + 2 < primitive.indices.size(); i += 3) {
      std::array<Corner, 3> corners{};
      for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t row = static_cast<std::size_t>(primitive.first_vertex) + primitive.indices[i + c];
        corners[c] = {asset.vertex_of_source[row], group_of_row_[row]};
      }
      const bool known = std::ranges::all_of(corners, [](const Corner& c) { return c.vertex >= 0; });
      if (known) triangles_.push_back(corners);
    }
  }

  std::vector<double> positions(3 * static_cast<std::size_t>(vertex_count));
  Eigen::Map<Field3>(positions.data(), vertex_count, 3) = asset.mesh.positions;
  computed_rest_.resize(3 * normal_of_group.size());
  sum_area_normals(positions, computed_rest_);
  rest_ = computed_rest_;
  for (int group = 0; group < static_cast<int>(normal_of_group.size()); ++group) {
    const Eigen::Vector3d& normal = normal_of_group[static_cast<std::size_t>(group)];
    if (normal.squaredNorm() > 0.0) vector_at(std::span(rest_), group) = normal;
  }
  rest_of_rows_.resize(3 * own.size());
  for (std::size_t row = 0; row < own.size(); ++row) {
    const int group = group_of_row_[row];
    Eigen::Vector3d normal = own[row];
    if (normal.squaredNorm() == 0.0)
      normal = group < 0 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d(vector_at(std::span(rest_), group));
    Eigen::Map<Eigen::Vector3f> out(&rest_of_rows_[3 * row]);
    out = normal.cast<float>();
  }
}

void SurfaceNormals::sum_area_normals(std::span<const double> positions, std::span<double> sums) const {
  std::ranges::fill(sums, 0.0);
  for (const std::array<Corner, 3>& corners : triangles_) {
    const Eigen::Vector3d a = vector_at(positions, corners[0].vertex);
    const Eigen::Vector3d normal =
        (vector_at(positions, corners[1].vertex) - a).cross(vector_at(positions, corners[2].vertex) - a);
    for (const Corner& corner : corners) vector_at(sums, corner.group) += normal;
  }
  for (std::size_t i = 0; i + 2 < sums.size(); i += 3) {
    Eigen::Map<Eigen::Vector3d> normal(&sums[i]);
    const double length = normal.norm();
    // Triangles without area, or that cancel: any unit vector is as good.
    normal = length > 0.0 ? Eigen::Vector3d(normal / length) : Eigen::Vector3d::UnitZ();
  }
}

void SurfaceNormals::deformed(std::span<const double> positions, std::span<double> normals) const {
  sum_area_normals(positions, normals);
  for (int group = 0; group < group_count(); ++group) {
    const Eigen::Vector3d now = vector_at(std::span<const double>(normals), group);
    vector_at(normals, group) = carried(vector_at(std::span<const double>(rest_), group),
                                        vector_at(std::span<const double>(computed_rest_), group), now);
  }
}

}  // namespace sinew
