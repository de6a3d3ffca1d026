#pragma once

#include <cmath>
#include <cstring>
#include <numbers>
#include <string>

#include "io/mesh_asset.h"

/// An upright tube as an exporter writes it: two primitives with two materials that share a ring, a
/// texture seam (first and last column of each ring lie at one place), and attributes of several kinds.
/// One row belongs to no triangle.
namespace tube {

template <typename Value>
sinew::VertexAttribute attribute(const std::string& name, int component_type, int components, bool normalized,
                                 const std::vector<Value>& values) {
  sinew::VertexAttribute result{name, component_type, components, normalized, {}};
  result.data.resize(values.size() * sizeof(Value));
  std::memcpy(result.data.data(), values.data(), result.data.size());
  return result;
}

struct Rows {
  std::vector<float> positions, normals, coordinates;
  std::vector<std::uint8_t> colours;
  std::vector<float> heat;
};

inline void add_ring(Rows& rows, double height, int sides) {
  for (int side = 0; side <= sides; ++side) {
    const double angle = 2.0 * std::numbers::pi * (side % sides) / sides;
    const auto x = static_cast<float>(std::cos(angle));
    const auto z = static_cast<float>(std::sin(angle));
    rows.positions.insert(rows.positions.end(), {0.25F * x, static_cast<float>(height), 0.25F * z});
    rows.normals.insert(rows.normals.end(), {x, 0.0F, z});
    rows.coordinates.insert(rows.coordinates.end(), {static_cast<float>(side) / static_cast<float>(sides),
                                                     static_cast<float>(height)});
    rows.colours.insert(rows.colours.end(), {static_cast<std::uint8_t>(side), 100, 200});
    rows.heat.push_back(static_cast<float>(height) * 10.0F);
  }
}

inline sinew::SourcePrimitive part(const std::string& name, int material, int first_row, double low,
                                   double high, int rings, int sides, bool with_normals,
                                   sinew::Field3& positions) {
  Rows rows;
  for (int ring = 0; ring < rings; ++ring) add_ring(rows, low + (high - low) * ring / (rings - 1), sides);
  sinew::SourcePrimitive primitive;
  primitive.name = name;
  primitive.material = material;
  primitive.first_vertex = first_row;
  primitive.vertex_count = rings * (sides + 1);
  for (int ring = 0; ring + 1 < rings; ++ring) {
    for (int side = 0; side < sides; ++side) {
      const auto a = static_cast<std::uint32_t>(ring * (sides + 1) + side);
      const std::uint32_t b = a + static_cast<std::uint32_t>(sides) + 1;
      primitive.indices.insert(primitive.indices.end(), {a, b, a + 1, a + 1, b, b + 1});
    }
  }
  if (with_normals) primitive.attributes.push_back(attribute("NORMAL", 5126, 3, false, rows.normals));
  primitive.attributes.push_back(attribute("TEXCOORD_0", 5126, 2, false, rows.coordinates));
  primitive.attributes.push_back(attribute("COLOR_0", 5121, 3, true, rows.colours));
  primitive.attributes.push_back(attribute("_HEAT", 5126, 1, false, rows.heat));
  positions.conservativeResize(first_row + primitive.vertex_count, 3);
  for (int row = 0; row < primitive.vertex_count; ++row)
    for (int axis = 0; axis < 3; ++axis)
      positions(first_row + row, axis) =
          static_cast<double>(rows.positions[static_cast<std::size_t>(3 * row + axis)]);
  return primitive;
}

inline sinew::MeshAsset asset(bool with_normals = true, int rings = 9, int sides = 12) {
  sinew::MeshAsset asset;
  asset.format = "glb";
  asset.primitives.push_back(part("leg", 1, 0, 0.0, 1.0, rings, sides, with_normals, asset.source_positions));
  asset.primitives.push_back(part("body", 0, static_cast<int>(asset.source_positions.rows()), 1.0, 2.0, rings,
                                  sides, with_normals, asset.source_positions));
  asset.appearance_json =
      R"({"materials":[{"name":"skin","pbrMetallicRoughness":{"baseColorTexture":{"index":0},"roughnessFactor":0.3}},)"
      R"({"name":"cloth","extensions":{"KHR_materials_ior":{"ior":1.4}}}],"textures":[{"sampler":0,"source":0}],)"
      R"("samplers":[{"wrapS":33071}],"images":[{"name":"paint","source":0}],"extensionsUsed":["KHR_materials_ior"]})";
  asset.images.push_back({"paint", "image/png", {}});
  // The smallest PNG there is: one grey pixel.
  for (const int byte :
       {0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0,    0,    0,    0x0d, 0x49, 0x48, 0x44, 0x52, 0,
        0,    0,    1,    0,    0,    0,    1,    8,    0,    0,    0,    0,    0x3a, 0x7e, 0x9b, 0x55, 0,
        0,    0,    0x0a, 0x49, 0x44, 0x41, 0x54, 0x78, 0x9c, 0x63, 0x68, 0,    0,    0,    0x82, 0,    0x81,
        0x4c, 0x17, 0xd7, 0xdf, 0,    0,    0,    0,    0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82})
    asset.images.back().bytes.push_back(static_cast<std::byte>(byte));
  // A row that no triangle uses, as exporters leave behind.
  sinew::SourcePrimitive& body = asset.primitives.back();
  asset.source_positions.conservativeResize(asset.source_positions.rows() + 1, 3);
  asset.source_positions.bottomRows(1).setZero();
  ++body.vertex_count;
  for (sinew::VertexAttribute& a : body.attributes)
    a.data.resize(a.data.size() / static_cast<std::size_t>(body.vertex_count - 1) *
                  static_cast<std::size_t>(body.vertex_count));
  sinew::weld_and_diagnose(asset);
  return asset;
}

/// Bends, twists, swells, turns about and walks off.
inline sinew::Field3 moved(const sinew::Field3& rest, double time) {
  sinew::Field3 positions(rest.rows(), 3);
  for (Eigen::Index i = 0; i < rest.rows(); ++i) {
    const double s = rest(i, 1) / 2.0;
    const double twist = 0.8 * std::sin(3.0 * time) * s + 0.2 * std::sin(7.0 * time + 4.0 * s);
    const double bend = 0.7 * std::sin(2.0 * time + 1.0) * s;
    const double swell = 1.0 + 0.1 * std::sin(5.0 * time + 6.0 * s);
    const Eigen::Vector3d p(swell * rest(i, 0), rest(i, 1), swell * rest(i, 2));
    const Eigen::Vector3d twisted(p.x() * std::cos(twist) + p.z() * std::sin(twist), p.y(),
                                  p.z() * std::cos(twist) - p.x() * std::sin(twist));
    const Eigen::Vector3d bent(twisted.x() * std::cos(bend) - twisted.y() * std::sin(bend),
                               twisted.x() * std::sin(bend) + twisted.y() * std::cos(bend), twisted.z());
    const double turn = 4.0 * time;
    positions.row(i) << bent.x() * std::cos(turn) + bent.z() * std::sin(turn) + 1.5 * time, bent.y(),
        bent.z() * std::cos(turn) - bent.x() * std::sin(turn) - 0.5 * time;
  }
  return positions;
}

}  // namespace tube
