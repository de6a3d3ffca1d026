#include "io/gltf_body.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <optional>

#include "io/file_error.h"

namespace sinew {
namespace {

/// What a scene may grow to by repeating its meshes; a file can ask for far more than its own size.
constexpr std::uint64_t kMostVertices = 20'000'000;
constexpr std::uint64_t kMostIndices = 100'000'000;
constexpr std::uint64_t kMostAttributeBytes = std::uint64_t{2} << 30;

/// Weights whose sum is further than this from 1 are reported; stored as bytes, four of them miss 1 by 2/255.
constexpr double kWeightSlack = 0.01;

enum PrimitiveMode { kTriangles = 4, kTriangleStrip = 5, kTriangleFan = 6 };

const GltfPrimitive& primitive_of(const GltfDocument& document, const GltfPart& part) {
  return document.meshes[part.mesh].primitives[part.primitive];
}

std::string where_of(const GltfDocument& document, const GltfPart& part) {
  return document.where("meshes", part.mesh) + "/primitives/" + std::to_string(part.primitive);
}

// ---- vertices and their joints

class BodyReader {
 public:
  explicit BodyReader(const GltfDocument& document) : document_(document) {}

  GltfBody read() {
    for (const int node : document_.scene_order) {
      const int mesh = document_.nodes[node].mesh;
      if (mesh < 0) continue;
      for (std::size_t i = 0; i < document_.meshes[mesh].primitives.size(); ++i) {
        consider({node, document_.nodes[node].skin, mesh, static_cast<int>(i), {}, 0, {}, {}});
      }
    }
    report();
    return std::move(body_);
  }

 private:
  void consider(GltfPart part) {
    const GltfPrimitive& primitive = primitive_of(document_, part);
    const int position = primitive.attribute("POSITION");
    if (primitive.mode < kTriangles || position < 0) {
      ++not_drawn_;
      return;
    }
    const int counted = primitive.indices < 0 ? position : primitive.indices;
    const std::uint64_t corners = document_.accessors[counted].count;
    const bool whole = primitive.mode == kTriangles ? corners % 3 == 0 : corners >= 3;
    if (!whole) ++left_over_;
    vertices_ += document_.accessors[position].count;
    indices_ += 3 * corners;
    for (const auto& [name, accessor] : primitive.attributes) {
      attribute_bytes_ += document_.accessors[accessor].count * 4 * document_.accessors[accessor].components;
    }
    if (vertices_ > kMostVertices || indices_ > kMostIndices || attribute_bytes_ > kMostAttributeBytes) {
      throw FileError(FileFault::resource, document_.where("nodes", part.node),
                      "with its mesh the scene has more than " + std::to_string(kMostVertices) +
                          " vertices, " + std::to_string(kMostIndices) + " indices or " +
                          std::to_string(kMostAttributeBytes) + " bytes of attributes");
    }
    part.positions = read_numbers(document_, position);
    if (part.skin >= 0) read_influences(primitive, part);
    body_.parts.push_back(std::move(part));
  }

  void read_influences(const GltfPrimitive& primitive, GltfPart& part) {
    int sets = 0;
    while (primitive.attribute("JOINTS_" + std::to_string(sets)) >= 0 &&
           primitive.attribute("WEIGHTS_" + std::to_string(sets)) >= 0) {
      ++sets;
    }
    if (sets == 0) {
      part.skin = -1;
      ++without_weights_;
      return;
    }
    part.influences = 4 * sets;
    part.slots.resize(static_cast<std::size_t>(part.influences) * part.vertex_count());
    part.weights.resize(part.slots.size());
    for (int set = 0; set < sets; ++set) read_set(primitive, set, part);
    for (int vertex = 0; vertex < part.vertex_count(); ++vertex) normalize(part, vertex);
  }

  void read_set(const GltfPrimitive& primitive, int set, GltfPart& part) {
    const std::string number = std::to_string(set);
    const std::vector<std::uint32_t> slots =
        read_whole_numbers(document_, primitive.attribute("JOINTS_" + number));
    const std::vector<double> weights = read_numbers(document_, primitive.attribute("WEIGHTS_" + number));
    const std::size_t joints = document_.skins[part.skin].joints.size();
    for (std::size_t i = 0; i < slots.size(); ++i) {
      const std::size_t vertex = i / 4;
      if (weights[i] < 0.0) {
        throw FileError(FileFault::malformed, where_of(document_, part) + "/attributes/WEIGHTS_" + number,
                        "vertex " + std::to_string(vertex) + " has a negative weight");
      }
      if (weights[i] > 0.0 && slots[i] >= joints) {
        throw FileError(FileFault::malformed, where_of(document_, part) + "/attributes/JOINTS_" + number,
                        "vertex " + std::to_string(vertex) + " names joint " + std::to_string(slots[i]) +
                            "; the skin has " + std::to_string(joints));
      }
      const std::size_t to = vertex * part.influences + 4 * static_cast<std::size_t>(set) + i % 4;
      part.slots[to] = weights[i] > 0.0 ? slots[i] : 0;
      part.weights[to] = weights[i];
    }
  }

  /// Viewers divide by the sum, and files rely on it: sums down to 0.18 occur in the wild.
  void normalize(GltfPart& part, int vertex) {
    double* weights = part.weights.data() + static_cast<std::size_t>(vertex) * part.influences;
    const double sum = std::accumulate(weights, weights + part.influences, 0.0);
    if (std::abs(sum - 1.0) > kWeightSlack) ++odd_sums_;
    if (sum > 0.0) {
      for (int i = 0; i < part.influences; ++i) weights[i] /= sum;
    } else {
      weights[0] = 1.0;
    }
  }

  void report() {
    const auto warn = [&](int count, const std::string& text) {
      if (count > 0)
        body_.warnings.push_back("W_GLTF_" + text.substr(0, text.find(':')) + ": " + std::to_string(count) +
                                 text.substr(text.find(':') + 1));
    };
    warn(not_drawn_, "PRIMITIVE: primitive(s) of points or lines, or without positions, are left out");
    warn(left_over_, "TRIANGLES: primitive(s) have one or two corners too many for their triangles");
    warn(without_weights_,
         "SKIN: primitive(s) of skinned nodes have no joints and weights and are placed by their node");
    warn(odd_sums_, "WEIGHTS_SUM: vertices have skin weights that do not sum to 1; they are normalized");
  }

  const GltfDocument& document_;
  GltfBody body_;
  std::uint64_t vertices_ = 0;
  std::uint64_t indices_ = 0;
  std::uint64_t attribute_bytes_ = 0;
  int not_drawn_ = 0;
  int left_over_ = 0;
  int without_weights_ = 0;
  int odd_sums_ = 0;
};

// ---- triangles

std::vector<std::uint32_t> corners_of(const GltfPrimitive& primitive, const GltfPart& part,
                                      const GltfDocument& document) {
  const auto vertices = static_cast<std::uint32_t>(part.vertex_count());
  if (primitive.indices < 0) {
    std::vector<std::uint32_t> sequence(vertices);
    std::iota(sequence.begin(), sequence.end(), 0u);
    return sequence;
  }
  std::vector<std::uint32_t> indices = read_whole_numbers(document, primitive.indices);
  for (std::size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] < vertices) continue;
    throw FileError(FileFault::malformed, where_of(document, part) + "/indices",
                    "index " + std::to_string(indices[i]) + " at place " + std::to_string(i) +
                        " is out of range; the primitive has " + std::to_string(vertices) + " vertices");
  }
  return indices;
}

/// Strips and fans as single triangles; glTF 2.0, section 3.7.2.1. A strip's stitches (two equal
/// corners) are no triangles and fall away.
std::vector<std::uint32_t> triangles_of(const GltfPrimitive& primitive, std::vector<std::uint32_t> corners) {
  if (primitive.mode == kTriangles) {
    corners.resize(corners.size() / 3 * 3);
    return corners;
  }
  std::vector<std::uint32_t> triangles;
  for (std::size_t i = 0; i + 2 < corners.size(); ++i) {
    const bool fan = primitive.mode == kTriangleFan;
    const std::uint32_t a = fan ? corners[i + 1] : corners[i];
    const std::uint32_t b = fan ? corners[i + 2] : corners[i + 1 + i % 2];
    const std::uint32_t c = fan ? corners[0] : corners[i + 2 - i % 2];
    if (a != b && b != c && c != a) triangles.insert(triangles.end(), {a, b, c});
  }
  return triangles;
}

// ---- attributes

bool is_skinning(const std::string& name) {
  return name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_");
}

VertexAttribute stored_attribute(const GltfDocument& document, const std::string& name, int accessor) {
  const GltfAccessor& from = document.accessors[accessor];
  return {name, from.component_type, from.components, from.normalized, read_packed(document, accessor)};
}

/// Where a part's directions go: one matrix a vertex, or nothing when no direction changes.
std::vector<Eigen::Matrix3d> direction_matrices(const GltfPart& part, const GltfDocument& document,
                                                const GltfBind& bind) {
  std::vector<Eigen::Matrix3d> matrices;
  bool changes = false;
  for_each_vertex_matrix(part, document, bind, bind.world, [&](int, const Eigen::Affine3d& matrix) {
    matrices.push_back(matrix.linear());
    const double size = matrix.linear().trace() / 3.0;
    changes = changes || !(matrix.linear() - size * Eigen::Matrix3d::Identity()).isZero(1e-6 * size);
  });
  if (!changes) matrices.clear();
  return matrices;
}

/// Normals by the inverse transpose, tangents as they lie in the surface; as floats.
VertexAttribute turned_attribute(const GltfDocument& document, const std::string& name, int accessor,
                                 const std::vector<Eigen::Matrix3d>& matrices) {
  const int components = document.accessors[accessor].components;
  const std::vector<double> from = read_numbers(document, accessor);
  std::vector<float> to(from.begin(), from.end());
  for (std::size_t vertex = 0; vertex < matrices.size(); ++vertex) {
    const Eigen::Vector3d direction = Eigen::Map<const Eigen::Vector3d>(from.data() + vertex * components);
    const Eigen::Matrix3d& matrix = matrices[vertex];
    const double determinant = matrix.determinant();
    // The cofactor matrix is the inverse transpose but for a factor, and exists for flat matrices as well.
    Eigen::Matrix3d cofactor;
    for (int i = 0; i < 3; ++i) cofactor.row(i) = matrix.row((i + 1) % 3).cross(matrix.row((i + 2) % 3));
    const double sign = determinant < 0.0 ? -1.0 : 1.0;
    const Eigen::Vector3d moved =
        name == "NORMAL" ? (sign * (cofactor * direction)).eval() : (matrix * direction).eval();
    const double length = moved.norm();
    for (int i = 0; i < 3; ++i)
      to[vertex * components + i] = static_cast<float>(length > 0.0 ? moved[i] / length : direction[i]);
    if (components == 4)
      to[vertex * components + 3] = static_cast<float>(sign * from[vertex * components + 3]);
  }
  VertexAttribute attribute{name, 5126, components, false, {}};
  attribute.data.resize(to.size() * sizeof(float));
  std::memcpy(attribute.data.data(), to.data(), attribute.data.size());
  return attribute;
}

std::vector<VertexAttribute> attributes_of(const GltfPart& part, const GltfDocument& document,
                                           const GltfBind& bind) {
  std::vector<VertexAttribute> attributes;
  std::optional<std::vector<Eigen::Matrix3d>> matrices;
  for (const auto& [name, accessor] : primitive_of(document, part).attributes) {
    if (name == "POSITION" || is_skinning(name) || document.accessors[accessor].is_matrix) continue;
    const bool direction = name == "NORMAL" || name == "TANGENT";
    if (direction && !matrices) matrices = direction_matrices(part, document, bind);
    if (direction && !matrices->empty())
      attributes.push_back(turned_attribute(document, name, accessor, *matrices));
    else
      attributes.push_back(stored_attribute(document, name, accessor));
  }
  return attributes;
}

/// True when the part stands mirrored in the scene, so that its triangles must be turned over to stay
/// counter-clockwise; glTF 2.0, section 3.7.4.
bool is_mirrored(const GltfPart& part, const GltfDocument& document, const GltfBind& bind) {
  std::optional<bool> mirrored;
  for_each_vertex_matrix(part, document, bind, bind.world, [&](int, const Eigen::Affine3d& matrix) {
    if (!mirrored) mirrored = matrix.linear().determinant() < 0.0;
  });
  return mirrored.value_or(false);
}

SourcePrimitive source_primitive(const GltfPart& part, const GltfDocument& document, const GltfBind& bind,
                                 int first_vertex) {
  const GltfPrimitive& from = primitive_of(document, part);
  SourcePrimitive to;
  to.name = document.meshes[part.mesh].name;
  if (to.name.empty()) to.name = document.nodes[part.node].name;
  to.first_vertex = first_vertex;
  to.vertex_count = part.vertex_count();
  to.indices = triangles_of(from, corners_of(from, part, document));
  to.material = from.material;
  to.attributes = attributes_of(part, document, bind);
  if (is_mirrored(part, document, bind)) {
    for (std::size_t i = 0; i + 2 < to.indices.size(); i += 3)
      std::swap(to.indices[i + 1], to.indices[i + 2]);
  }
  return to;
}

}  // namespace

GltfBody read_gltf_body(const GltfDocument& document) {
  return BodyReader(document).read();
}

Field3 place_vertices(const GltfBody& body, const GltfDocument& document, const GltfBind& bind,
                      const std::vector<Eigen::Affine3d>& world) {
  int count = 0;
  for (const GltfPart& part : body.parts) count += part.vertex_count();
  Field3 placed(count, 3);
  int row = 0;
  for (const GltfPart& part : body.parts) {
    for_each_vertex_matrix(part, document, bind, world, [&](int vertex, const Eigen::Affine3d& matrix) {
      placed.row(row++) = matrix * Eigen::Map<const Eigen::Vector3d>(part.positions.data() + 3 * vertex);
    });
  }
  return placed;
}

MeshAsset bind_mesh(const GltfBody& body, const GltfDocument& document, const GltfBind& bind) {
  MeshAsset asset;
  asset.path = document.path;
  asset.format = document.is_glb ? "glb" : "gltf";
  asset.source_positions = place_vertices(body, document, bind, bind.world);
  if (!asset.source_positions.allFinite()) {
    throw FileError(FileFault::malformed, document.file, "a vertex of the bind pose is not finite");
  }
  int first_vertex = 0;
  for (const GltfPart& part : body.parts) {
    asset.primitives.push_back(source_primitive(part, document, bind, first_vertex));
    first_vertex += part.vertex_count();
  }
  asset.appearance_json = document.appearance.json;
  asset.images = document.appearance.images;
  for (const auto* warnings : {&document.warnings, &body.warnings, &bind.warnings}) {
    asset.warnings.insert(asset.warnings.end(), warnings->begin(), warnings->end());
  }
  return asset;
}

}  // namespace sinew
