// glTF 2.0 specification (Khronos 2021). Where viewers differ, what all of them read is written:
// three.js, Babylon.js and Blender show these files alike. Blender clamps morph weights to [0, 1],
// engines stop at 64 targets a mesh, and some readers mistake sparse accessors.
#include "io/gltf_writer.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "io/file_error.h"
#include "io/glb_container.h"
#include "io/key_reduction.h"
#include "io/morph_basis.h"
#include "io/morph_normals.h"
#include "io/surface_normals.h"

namespace sinew {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kMostTargets = 63;
constexpr int kFloat = 5126;
constexpr int kUnsignedByte = 5121;
constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;
constexpr int kVertexTarget = 34962;
constexpr int kIndexTarget = 34963;

/// Above this, browsers and Blender need gigabytes and many seconds to open a file of morph targets.
constexpr std::int64_t kUnhandyBytes = 300'000'000;

/// The double whose shortest form is the shortest form of `value` as a float: 0.1, not 0.10000000149.
double shortest(float value) {
  char text[32];
  const auto end = std::to_chars(text, text + sizeof text, value).ptr;
  double result = 0.0;
  std::from_chars(text, end, result);
  return result;
}

template <typename Range>
Json numbers(const Range& values) {
  Json list = Json::array();
  for (const float value : values) list.push_back(shortest(value));
  return list;
}

const char* type_name(int components) {
  constexpr const char* kNames[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  return kNames[components - 1];
}

int component_size(int component_type) {
  switch (component_type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    default:
      return 4;
  }
}

template <typename Value>
std::vector<std::byte> bytes_of(std::span<const Value> values) {
  std::vector<std::byte> bytes(values.size_bytes());
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

// ---------------------------------------------------------------------------------------------
// What the asset must fulfil

[[noreturn]] void reject(const std::string& what) {
  throw std::invalid_argument("GltfWriter: " + what);
}

void check_primitive(const MeshAsset& asset, const SourcePrimitive& primitive) {
  const std::string name = "primitive '" + primitive.name + "'";
  const auto rows = static_cast<std::int64_t>(asset.vertex_of_source.size());
  if (primitive.first_vertex < 0 || primitive.vertex_count < 0 ||
      static_cast<std::int64_t>(primitive.first_vertex) + primitive.vertex_count > rows)
    reject(name + " has vertices outside the source's " + std::to_string(rows));
  for (const std::uint32_t index : primitive.indices)
    if (index >= static_cast<std::uint32_t>(primitive.vertex_count))
      reject(name + " has index " + std::to_string(index) + "; expected below " +
             std::to_string(primitive.vertex_count));
  for (const VertexAttribute& attribute : primitive.attributes) {
    const auto expected =
        static_cast<std::size_t>(primitive.vertex_count) *
        static_cast<std::size_t>(attribute.components * component_size(attribute.component_type));
    if (attribute.components < 1 || attribute.components > 4 || attribute.data.size() != expected)
      reject(name + " has " + std::to_string(attribute.data.size()) + " bytes of " + attribute.name +
             "; expected " + std::to_string(expected));
  }
}

void check_asset(const MeshAsset& asset) {
  if (asset.source_positions.rows() != static_cast<Eigen::Index>(asset.vertex_of_source.size()))
    reject(std::to_string(asset.source_positions.rows()) + " source positions and " +
           std::to_string(asset.vertex_of_source.size()) + " source vertices; expected as many");
  for (const int vertex : asset.vertex_of_source)
    if (vertex < -1 || vertex >= asset.mesh.vertex_count())
      reject("a source vertex is welded to vertex " + std::to_string(vertex) + "; the mesh has " +
             std::to_string(asset.mesh.vertex_count()));
  for (const SourcePrimitive& primitive : asset.primitives) check_primitive(asset, primitive);
}

void check_options(const GltfWriterOptions& options) {
  if (!(options.frames_per_second > 0.0) || !std::isfinite(options.frames_per_second))
    reject("frames per second is " + std::to_string(options.frames_per_second) + "; expected above 0");
  if (options.max_targets < 2 || options.max_targets > kMostTargets)
    reject("max_targets is " + std::to_string(options.max_targets) + "; expected 2 to 63");
  if (!(options.tolerance >= 0.0)) reject("the tolerance is negative");
  if (!(options.key_tolerance >= 0.0)) reject("the key tolerance is negative");
}

// ---------------------------------------------------------------------------------------------
// The document: JSON and binary chunk side by side

class Document {
 public:
  struct Bounds {
    std::vector<float> low, high;
  };

  int add_view(std::vector<std::byte> bytes, int target = 0, int stride = 0) {
    Json view = {{"buffer", 0}, {"byteOffset", 0}, {"byteLength", bytes.size()}};
    view["byteOffset"] = binary.append(std::move(bytes));
    if (stride > 0) view["byteStride"] = stride;
    if (target > 0) view["target"] = target;
    views_.push_back(std::move(view));
    return static_cast<int>(views_.size()) - 1;
  }

  int add_accessor(int view, std::int64_t offset, int component_type, std::int64_t count, int components,
                   bool normalized = false, const std::optional<Bounds>& bounds = {}) {
    Json accessor = {{"bufferView", view}, {"byteOffset", offset}, {"componentType", component_type}};
    if (normalized) accessor["normalized"] = true;
    accessor["count"] = count;
    accessor["type"] = type_name(components);
    if (bounds) accessor["min"] = numbers(bounds->low), accessor["max"] = numbers(bounds->high);
    accessors_.push_back(std::move(accessor));
    return static_cast<int>(accessors_.size()) - 1;
  }

  /// Floats of an animation; `components` of them a key.
  int add_keys(std::span<const float> values, int components, bool with_bounds = false) {
    const auto count = static_cast<std::int64_t>(values.size()) / components;
    std::optional<Bounds> bounds;
    if (with_bounds) bounds = Bounds{{values.front()}, {values.back()}};
    return add_accessor(add_view(bytes_of(values)), 0, kFloat, count, components, false, bounds);
  }

  int add_node(Json node) {
    nodes.push_back(std::move(node));
    return static_cast<int>(nodes.size()) - 1;
  }

  int add_sampler(int input, int output, const char* interpolation) {
    samplers_.push_back({{"input", input}, {"interpolation", interpolation}, {"output", output}});
    return static_cast<int>(samplers_.size()) - 1;
  }

  void add_channel(int sampler, int node, const char* path) {
    channels_.push_back({{"sampler", sampler}, {"target", {{"node", node}, {"path", path}}}});
  }

  std::string text(const std::string& animation_name, const Json& appearance) const;

  Json nodes = Json::array();
  Json meshes = Json::array();
  Json roots = Json::array();
  Json images = Json::array();
  std::vector<std::string> extensions_used, extensions_required;
  GlbBinary binary;

 private:
  Json views_ = Json::array();
  Json accessors_ = Json::array();
  Json samplers_ = Json::array();
  Json channels_ = Json::array();
};

std::string Document::text(const std::string& animation_name, const Json& appearance) const {
  Json json;
  json["asset"] = {{"version", "2.0"}, {"generator", "sinew " SINEW_VERSION}};
  if (!extensions_used.empty()) json["extensionsUsed"] = extensions_used;
  if (!extensions_required.empty()) json["extensionsRequired"] = extensions_required;
  json["scene"] = 0;
  json["scenes"] = Json::array({{{"nodes", roots}}});
  const auto put = [&json](const char* name, const Json& list) {
    if (!list.empty()) json[name] = list;
  };
  put("nodes", nodes);
  put("meshes", meshes);
  for (const char* name : {"materials", "textures", "samplers"})
    if (appearance.contains(name)) put(name, appearance[name]);
  put("images", images);
  put("accessors", accessors_);
  put("bufferViews", views_);
  if (binary.size() > 0) json["buffers"] = Json::array({{{"byteLength", binary.size()}}});
  if (!channels_.empty()) {
    const Json animation = {{"name", animation_name}, {"channels", channels_}, {"samplers", samplers_}};
    json["animations"] = Json::array({animation});
  }
  // Names come from files of any encoding; what is not UTF-8 becomes the replacement character.
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// ---------------------------------------------------------------------------------------------
// Appearance

bool is_core_attribute(const VertexAttribute& attribute) {
  const bool small_normalized = attribute.normalized && (attribute.component_type == kUnsignedByte ||
                                                         attribute.component_type == kUnsignedShort);
  if (attribute.name.starts_with("TEXCOORD_") || attribute.name.starts_with("COLOR_"))
    return attribute.component_type == kFloat || small_normalized;
  return attribute.name != "TANGENT" || attribute.component_type == kFloat;
}

/// Vertex data that another part of the file already says, or that has no meaning without a skin.
bool is_left_out(const std::string& name) {
  return name == "POSITION" || name == "NORMAL" || name.starts_with("JOINTS_") ||
         name.starts_with("WEIGHTS_");
}

void add_extension(std::vector<std::string>& list, const std::string& name) {
  if (std::ranges::find(list, name) == list.end()) list.push_back(name);
}

/// Materials and what they use, as the source has them; an empty object when it has none.
Json read_appearance(const MeshAsset& asset, Document& document) {
  if (asset.appearance_json.empty()) return Json::object();
  Json appearance = Json::parse(asset.appearance_json, nullptr, false);
  if (!appearance.is_object()) reject("appearance_json is not a JSON object");
  for (const auto& name : appearance.value("extensionsUsed", Json::array()))
    add_extension(document.extensions_used, name.get<std::string>());
  for (const auto& name : appearance.value("extensionsRequired", Json::array()))
    add_extension(document.extensions_required, name.get<std::string>());
  return appearance;
}

/// For sources without materials: glTF's default material is a metal, black in a viewer without surroundings.
Json matt_grey(bool double_sided) {
  const Json surface = {
      {"baseColorFactor", {0.8, 0.8, 0.8, 1.0}}, {"metallicFactor", 0.0}, {"roughnessFactor", 0.8}};
  return {{"name", "matt"}, {"pbrMetallicRoughness", surface}, {"doubleSided", double_sided}};
}

void add_images(const MeshAsset& asset, const Json& appearance, Document& document) {
  if (!appearance.contains("images")) return;
  for (Json image : appearance["images"]) {
    const auto source = image.value("source", std::size_t{0});
    if (source >= asset.images.size()) reject("image " + std::to_string(source) + " has no bytes");
    image.erase("source");
    image["mimeType"] = asset.images[source].mime_type;
    image["bufferView"] = document.add_view(asset.images[source].bytes);
    document.images.push_back(std::move(image));
  }
}

// ---------------------------------------------------------------------------------------------
// Geometry

/// Primitives that came from one mesh: consecutive ones of the same name.
struct MeshGroup {
  std::string name;
  std::vector<const SourcePrimitive*> primitives;
};

std::vector<MeshGroup> group_primitives(const MeshAsset& asset) {
  std::vector<MeshGroup> groups;
  for (const SourcePrimitive& primitive : asset.primitives) {
    if (primitive.indices.empty()) continue;
    if (groups.empty() || groups.back().name != primitive.name) groups.push_back({primitive.name, {}});
    groups.back().primitives.push_back(&primitive);
  }
  return groups;
}

std::vector<float> to_floats(const Eigen::Ref<const Field3>& positions) {
  std::vector<float> floats(static_cast<std::size_t>(positions.size()));
  Eigen::Map<Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>>(floats.data(), positions.rows(), 3) =
      positions.cast<float>();
  return floats;
}

/// Three floats for every row of the source: those of its entry in `values`, zeros where it has none (-1).
std::vector<float> spread(std::span<const float> values, std::span<const int> entry_of_row) {
  std::vector<float> rows(3 * entry_of_row.size(), 0.0F);
  for (std::size_t row = 0; row < entry_of_row.size(); ++row)
    if (entry_of_row[row] >= 0)
      std::copy_n(&values[3 * static_cast<std::size_t>(entry_of_row[row])], 3, &rows[3 * row]);
  return rows;
}

Document::Bounds bounds_of(std::span<const float> rows, const SourcePrimitive& primitive) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Document::Bounds bounds{std::vector<float>(3, kInfinity), std::vector<float>(3, -kInfinity)};
  const std::size_t first = 3 * static_cast<std::size_t>(primitive.first_vertex);
  for (std::size_t i = 0; i < 3 * static_cast<std::size_t>(primitive.vertex_count); ++i) {
    bounds.low[i % 3] = std::min(bounds.low[i % 3], rows[first + i]);
    bounds.high[i % 3] = std::max(bounds.high[i % 3], rows[first + i]);
  }
  return bounds;
}

/// Writes the meshes of one asset, once or (exact mode) once a chunk; what does not change between
/// chunks is stored once.
class Geometry {
 public:
  Geometry(const MeshAsset& asset, bool with_normals, Document& document)
      : asset_(asset), document_(document), groups_(group_primitives(asset)) {
    if (with_normals) normals_.emplace(asset);
    appearance_ = read_appearance(asset, document);
    material_count_ = static_cast<int>(appearance_.value("materials", Json::array()).size());
    if (material_count_ == 0) appearance_["materials"] = Json::array({matt_grey(!asset.diagnosis.closed)});
    rest_ = to_floats(asset.mesh.positions);
    rest_rows_ = to_floats(asset.source_positions);
    position_view_ = add_rows(rest_rows_);
    if (normals_) normal_view_ = add_rows(normals_->rest_of_rows());
    for (const MeshGroup& group : groups_)
      for (const SourcePrimitive* primitive : group.primitives) base_.push_back(base_of(*primitive));
    add_images(asset, appearance_, document);
  }

  const std::vector<float>& rest() const { return rest_; }
  const SurfaceNormals* normals() const { return normals_ ? &*normals_ : nullptr; }
  const Json& appearance() const { return appearance_; }
  const std::vector<MeshGroup>& groups() const { return groups_; }

  /// A target's accessors, one a primitive. `displacements`: three floats a vertex; `normals`: three a group.
  void add_target(std::span<const float> displacements, std::span<const float> normals,
                  const std::string& name) {
    const std::vector<float> position_rows = spread(displacements, asset_.vertex_of_source);
    const int position_view = add_rows(position_rows);
    std::optional<int> normal_view;
    if (normals_) normal_view = add_rows(spread(normals, normals_->group_of_row()));
    std::vector<Json> target;
    for (const MeshGroup& group : groups_) {
      for (const SourcePrimitive* primitive : group.primitives) {
        Json accessors;
        accessors["POSITION"] =
            add_row_accessor(position_view, *primitive, bounds_of(position_rows, *primitive));
        if (normal_view) accessors["NORMAL"] = add_row_accessor(*normal_view, *primitive);
        target.push_back(std::move(accessors));
      }
    }
    targets_.push_back(std::move(target));
    target_names_.push_back(name);
  }

  /// Meshes with targets first up to first + count; their indices, one a group.
  std::vector<int> add_meshes(std::size_t first, std::size_t count) {
    std::vector<int> meshes;
    std::size_t index = 0;
    for (const MeshGroup& group : groups_) {
      Json primitives = Json::array();
      for (std::size_t p = 0; p < group.primitives.size(); ++p, ++index) {
        Json primitive = base_[index];
        for (std::size_t k = first; k < first + count; ++k)
          primitive["targets"].push_back(targets_[k][index]);
        primitives.push_back(std::move(primitive));
      }
      Json mesh;
      if (!group.name.empty()) mesh["name"] = group.name;
      mesh["primitives"] = std::move(primitives);
      if (count > 0) {
        mesh["weights"] = std::vector<int>(count, 0);
        mesh["extras"]["targetNames"] =
            std::vector<std::string>(target_names_.begin() + static_cast<std::ptrdiff_t>(first),
                                     target_names_.begin() + static_cast<std::ptrdiff_t>(first + count));
      }
      document_.meshes.push_back(std::move(mesh));
      meshes.push_back(static_cast<int>(document_.meshes.size()) - 1);
    }
    return meshes;
  }

 private:
  int add_rows(std::span<const float> rows) { return document_.add_view(bytes_of(rows), kVertexTarget, 12); }

  int add_row_accessor(int view, const SourcePrimitive& primitive,
                       const std::optional<Document::Bounds>& bounds = {}) {
    return document_.add_accessor(view, 12LL * primitive.first_vertex, kFloat, primitive.vertex_count, 3,
                                  false, bounds);
  }

  Json base_of(const SourcePrimitive& primitive);
  int add_attribute(const SourcePrimitive& primitive, const VertexAttribute& attribute);
  int add_indices(const SourcePrimitive& primitive);

  const MeshAsset& asset_;
  Document& document_;
  std::vector<MeshGroup> groups_;
  std::optional<SurfaceNormals> normals_;
  Json appearance_;
  int material_count_ = 0;        ///< of the source
  std::vector<float> rest_;       ///< of the welded vertices
  std::vector<float> rest_rows_;  ///< of the source's
  int position_view_ = -1;
  int normal_view_ = -1;
  std::vector<Json> base_;                  ///< a primitive without targets
  std::vector<std::vector<Json>> targets_;  ///< of target k: a primitive's accessors
  std::vector<std::string> target_names_;
};

int Geometry::add_attribute(const SourcePrimitive& primitive, const VertexAttribute& attribute) {
  const int size = attribute.components * component_size(attribute.component_type);
  const int stride = (size + 3) / 4 * 4;
  if (!is_core_attribute(attribute)) {
    add_extension(document_.extensions_used, "KHR_mesh_quantization");
    add_extension(document_.extensions_required, "KHR_mesh_quantization");
  }
  // Vertex attributes start at multiples of four bytes.
  std::vector<std::byte> bytes(static_cast<std::size_t>(primitive.vertex_count * stride), std::byte{0});
  for (int i = 0; i < primitive.vertex_count; ++i)
    std::copy_n(attribute.data.begin() + static_cast<std::ptrdiff_t>(i) * size, size,
                bytes.begin() + static_cast<std::ptrdiff_t>(i) * stride);
  const int view = document_.add_view(std::move(bytes), kVertexTarget, stride);
  return document_.add_accessor(view, 0, attribute.component_type, primitive.vertex_count,
                                attribute.components, attribute.normalized);
}

int Geometry::add_indices(const SourcePrimitive& primitive) {
  const auto count = static_cast<std::int64_t>(primitive.indices.size());
  // The largest value of a type restarts a strip and is not an index.
  if (primitive.vertex_count <= std::numeric_limits<std::uint16_t>::max()) {
    const std::vector<std::uint16_t> narrow(primitive.indices.begin(), primitive.indices.end());
    return document_.add_accessor(
        document_.add_view(bytes_of(std::span<const std::uint16_t>(narrow)), kIndexTarget), 0, kUnsignedShort,
        count, 1);
  }
  const std::span<const std::uint32_t> wide(primitive.indices);
  return document_.add_accessor(document_.add_view(bytes_of(wide), kIndexTarget), 0, kUnsignedInt, count, 1);
}

Json Geometry::base_of(const SourcePrimitive& primitive) {
  Json attributes;
  attributes["POSITION"] = add_row_accessor(position_view_, primitive, bounds_of(rest_rows_, primitive));
  if (normals_) attributes["NORMAL"] = add_row_accessor(normal_view_, primitive);
  for (const VertexAttribute& attribute : primitive.attributes)
    if (!is_left_out(attribute.name)) attributes[attribute.name] = add_attribute(primitive, attribute);
  Json json = {{"attributes", std::move(attributes)}, {"indices", add_indices(primitive)}};
  if (material_count_ == 0) {
    json["material"] = 0;
  } else if (primitive.material >= material_count_) {
    reject("primitive '" + primitive.name + "' has material " + std::to_string(primitive.material) +
           "; there are " + std::to_string(material_count_));
  } else if (primitive.material >= 0) {
    json["material"] = primitive.material;
  }
  return json;
}

// ---------------------------------------------------------------------------------------------
// The two kinds

std::vector<float> key_times(std::span<const int> frames, double frames_per_second) {
  std::vector<float> times;
  for (const int frame : frames) times.push_back(static_cast<float>(frame / frames_per_second));
  return times;
}

std::vector<int> count_up(std::size_t count) {
  std::vector<int> frames(count);
  for (std::size_t i = 0; i < count; ++i) frames[i] = static_cast<int>(i);
  return frames;
}

Json node_of(const std::string& name, int mesh) {
  Json node;
  if (!name.empty()) node["name"] = name;
  node["mesh"] = mesh;
  return node;
}

std::string numbered(const char* stem, int number) {
  std::string digits = std::to_string(number);
  if (digits.size() < 4) digits.insert(0, 4 - digits.size(), '0');
  return stem + digits;
}

/// Everything both kinds share while a file takes shape.
struct Draft {
  const MeshAsset& asset;
  const GltfWriterOptions& options;
  FrameSpan frames;
  const std::filesystem::path& path;
  double diagonal;
  Document& document;
  Geometry& geometry;
};

std::int64_t target_bytes(const Draft& draft) {
  const int vectors = draft.geometry.normals() != nullptr ? 2 : 1;
  return 12LL * vectors * static_cast<std::int64_t>(draft.asset.vertex_of_source.size());
}

void refuse_if_too_large(const Draft& draft, std::int64_t targets) {
  const std::int64_t bytes = draft.document.binary.size() + targets * target_bytes(draft);
  const std::int64_t limit = std::min(draft.options.max_bytes, kLargestGlb);
  if (bytes <= limit) return;
  throw FileError(FileFault::resource, draft.path.string(),
                  std::to_string(targets) + " morph targets make a file of " +
                      std::to_string(bytes / 1'000'000) + " MB; expected at most " +
                      std::to_string(limit / 1'000'000) + " MB (a sequence of OBJ files has no such limit)");
}

void put_errors(const ShapeError& error, double diagonal, GltfWriteReport& report) {
  const double scale = diagonal > 0.0 ? 1.0 / diagonal : 1.0;
  report.max_error = error.max * scale;
  report.p999_error = error.p999 * scale;
  report.rms_error = error.rms * scale;
}

/// Node above all meshes that carries the rigid motion about the centre of the rest shape; returns its index.
int add_rigid_node(Draft& draft, const RigidMotion& motion, int times) {
  const Eigen::Vector3f& centre = motion.rest_centre;
  const int node = draft.document.add_node({{"name", "motion"}, {"translation", numbers(centre)}});
  std::vector<float> rotations, centres;
  for (std::size_t f = 0; f < draft.frames.size(); ++f) {
    const Eigen::Vector4f& rotation = motion.rotations[f].coeffs();  // x y z w, as glTF has it
    rotations.insert(rotations.end(), rotation.data(), rotation.data() + 4);
    centres.insert(centres.end(), motion.centres[f].data(), motion.centres[f].data() + 3);
  }
  Document& document = draft.document;
  document.add_channel(document.add_sampler(times, document.add_keys(centres, 3), "LINEAR"), node,
                       "translation");
  document.add_channel(document.add_sampler(times, document.add_keys(rotations, 4), "LINEAR"), node,
                       "rotation");
  return node;
}

void add_pca_targets(Draft& draft, const RigidMotion& motion, const MorphClip& clip) {
  std::vector<std::vector<float>> normals;
  if (const SurfaceNormals* surface = draft.geometry.normals())
    normals = fit_morph_normals(*surface, draft.frames, motion, clip);
  for (int k = 0; k < clip.target_count(); ++k) {
    const auto index = static_cast<std::size_t>(k);
    const bool offset = clip.has_offset && k == 0;
    draft.geometry.add_target(
        clip.targets[index],
        normals.empty() ? std::span<const float>() : std::span<const float>(normals[index]),
        offset ? "offset" : numbered("component_", k));
  }
}

void write_pca(Draft& draft, GltfWriteReport& report) {
  Document& document = draft.document;
  const RigidMotion motion = fit_rigid_motion(draft.geometry.rest(), draft.frames);
  const MorphOptions wanted{.max_targets = draft.options.max_targets,
                            .tolerance = draft.options.tolerance * draft.diagonal,
                            .smallest = 1e-7 * draft.diagonal};
  const MorphClip clip = fit_morph_targets(draft.geometry.rest(), draft.frames, motion, wanted);
  refuse_if_too_large(draft, clip.target_count());

  const std::vector<int> frames = count_up(draft.frames.size());
  const int times = document.add_keys(key_times(frames, draft.options.frames_per_second), 1, true);
  const int root = add_rigid_node(draft, motion, times);
  document.roots.push_back(root);
  add_pca_targets(draft, motion, clip);
  const auto targets = static_cast<std::size_t>(clip.target_count());
  std::optional<int> weights;
  if (targets > 0) weights = document.add_sampler(times, document.add_keys(clip.weights, 1), "LINEAR");

  const std::vector<int> meshes = draft.geometry.add_meshes(0, targets);
  const Eigen::Vector3f back = -motion.rest_centre;
  for (std::size_t g = 0; g < meshes.size(); ++g) {
    Json json = node_of(draft.geometry.groups()[g].name, meshes[g]);
    json["translation"] = numbers(back);
    const int node = document.add_node(std::move(json));
    document.nodes[static_cast<std::size_t>(root)]["children"].push_back(node);
    if (weights) document.add_channel(*weights, node, "weights");
  }
  report.targets = clip.target_count();
  put_errors(measure_morph_clip(draft.geometry.rest(), draft.frames, motion, clip), draft.diagonal, report);
}

/// Displacements as stored for each key, one set of three floats a vertex.
std::vector<float> displacement(std::span<const float> rest, const std::vector<float>& frame) {
  std::vector<float> result(frame.size());
  for (std::size_t i = 0; i < frame.size(); ++i) result[i] = frame[i] - rest[i];
  return result;
}

std::vector<float> exact_normals(const SurfaceNormals& surface, const std::vector<float>& frame) {
  const std::vector<double> positions(frame.begin(), frame.end());
  std::vector<double> now(surface.rest().size());
  surface.deformed(positions, now);
  std::vector<float> result(now.size());
  for (std::size_t i = 0; i < now.size(); ++i) result[i] = static_cast<float>(now[i] - surface.rest()[i]);
  return result;
}

ShapeError measure_exact(std::span<const float> rest, FrameSpan frames, std::span<const int> keys) {
  ErrorStatistics statistics;
  std::size_t next = 0;
  for (int frame = 0; frame < static_cast<int>(frames.size()); ++frame) {
    if (keys[next] < frame) ++next;
    const std::size_t before = keys[next] == frame ? next : next - 1;
    const auto& a = frames[static_cast<std::size_t>(keys[before])];
    const auto& b = frames[static_cast<std::size_t>(keys[next])];
    const double share =
        before == next ? 0.0 : static_cast<double>(frame - keys[before]) / (keys[next] - keys[before]);
    const auto& truth = frames[static_cast<std::size_t>(frame)];
    for (std::size_t i = 0; i + 2 < truth.size(); i += 3) {
      Eigen::Vector3d difference;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const std::size_t at = i + axis;
        const double stored_a = static_cast<double>(a[at] - rest[at]);
        const double stored_b = static_cast<double>(b[at] - rest[at]);
        difference[static_cast<Eigen::Index>(axis)] = static_cast<double>(rest[at]) +
                                                      (1.0 - share) * stored_a + share * stored_b -
                                                      static_cast<double>(truth[at]);
      }
      statistics.add(difference.norm());
    }
  }
  return statistics.result();
}

/// Keys of one chunk: `first` up to and including `last`, as positions in the list of kept frames.
struct Chunk {
  std::size_t first;
  std::size_t last;
};

/// Neighbours share a key, so that the shape at the seam, and on both sides of it, is whole in one of them.
std::vector<Chunk> chunks_of(std::size_t key_count) {
  std::vector<Chunk> chunks;
  std::size_t first = 0;
  do {
    const std::size_t last = std::min(first + kMostTargets - 1, key_count - 1);
    chunks.push_back({first, last});
    first = last;
  } while (first + 1 < key_count);
  return chunks;
}

/// Weights of a chunk: target i is 1 at key i. Bytes 0 and 255 are exactly 0 and 1.
int add_one_hot_weights(Document& document, std::size_t count) {
  std::vector<std::uint8_t> weights(count * count, 0);
  for (std::size_t i = 0; i < count; ++i) weights[i * count + i] = 255;
  const int view = document.add_view(bytes_of(std::span<const std::uint8_t>(weights)));
  return document.add_accessor(view, 0, kUnsignedByte, static_cast<std::int64_t>(weights.size()), 1, true);
}

/// Shows a chunk from its first key until its last, the final one for ever.
void add_toggle(Document& document, int node, const Chunk& chunk, std::span<const float> times) {
  std::vector<float> keys, scales;
  const auto put = [&](float time, float scale) {
    keys.push_back(time);
    scales.insert(scales.end(), 3, scale);
  };
  if (chunk.first > 0) put(times.front(), 0.0F);
  put(times[chunk.first], 1.0F);
  if (chunk.last + 1 < times.size()) put(times[chunk.last], 0.0F);
  const int sampler =
      document.add_sampler(document.add_keys(keys, 1, true), document.add_keys(scales, 3), "STEP");
  document.add_channel(sampler, node, "scale");
}

void add_chunk(Draft& draft, const Chunk& chunk, std::span<const float> times) {
  Document& document = draft.document;
  const std::size_t count = chunk.last - chunk.first + 1;
  const int input = document.add_keys(times.subspan(chunk.first, count), 1, true);
  const int sampler = document.add_sampler(input, add_one_hot_weights(document, count), "LINEAR");
  const std::vector<int> meshes = draft.geometry.add_meshes(chunk.first, count);
  Json children = Json::array();
  for (std::size_t g = 0; g < meshes.size(); ++g) {
    const int node = document.add_node(node_of(draft.geometry.groups()[g].name, meshes[g]));
    document.add_channel(sampler, node, "weights");
    children.push_back(node);
  }
  if (count == times.size()) {
    document.roots = std::move(children);
    return;
  }
  Json json = {{"name", numbered("keys_", static_cast<int>(chunk.first))}, {"children", std::move(children)}};
  if (chunk.first > 0) json["scale"] = {0, 0, 0};
  const int node = document.add_node(std::move(json));
  document.roots.push_back(node);
  add_toggle(document, node, chunk, times);
}

void write_exact(Draft& draft, GltfWriteReport& report) {
  const std::vector<int> keys = keys_to_keep(draft.frames, draft.options.key_tolerance * draft.diagonal);
  refuse_if_too_large(draft, static_cast<std::int64_t>(keys.size()));
  for (const int key : keys) {
    const std::vector<float>& frame = draft.frames[static_cast<std::size_t>(key)];
    std::vector<float> normals;
    if (const SurfaceNormals* surface = draft.geometry.normals()) normals = exact_normals(*surface, frame);
    draft.geometry.add_target(displacement(draft.geometry.rest(), frame), normals, numbered("frame_", key));
  }
  const std::vector<float> times = key_times(keys, draft.options.frames_per_second);
  for (const Chunk& chunk : chunks_of(keys.size())) add_chunk(draft, chunk, times);
  report.targets = static_cast<int>(keys.size());
  put_errors(measure_exact(draft.geometry.rest(), draft.frames, keys), draft.diagonal, report);
}

void warn(const MeshAsset& asset, GltfWriteReport& report) {
  const bool tangents = std::ranges::any_of(asset.primitives, [](const SourcePrimitive& primitive) {
    return std::ranges::any_of(primitive.attributes,
                               [](const VertexAttribute& a) { return a.name == "TANGENT"; });
  });
  if (tangents)
    report.warnings.push_back(
        "W_GLTF_STATIC_TANGENTS: the source's tangents are written as they are and do not follow the motion");
  if (report.bytes > kUnhandyBytes)
    report.warnings.push_back(
        "W_GLTF_LARGE: " + std::to_string(report.bytes / 1'000'000) +
        " MB of morph targets; viewers need several times that memory (a sequence of OBJ "
        "files, or the pca kind, is easier to open)");
}

}  // namespace

GltfWriter::GltfWriter(const MeshAsset& asset, const GltfWriterOptions& options)
    : asset_(asset), options_(options) {
  check_options(options);
  check_asset(asset);
}

void GltfWriter::add_frame(const Eigen::Ref<const Field3>& positions) {
  const Eigen::Index count = asset_.mesh.vertex_count();
  const std::string where = "GltfWriter::add_frame: frame " + std::to_string(frames_.size());
  if (positions.rows() < count)
    throw std::invalid_argument(where + " has " + std::to_string(positions.rows()) +
                                " positions; expected at least " + std::to_string(count));
  std::vector<float> frame(3 * static_cast<std::size_t>(count));
  Eigen::Map<Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>> floats(frame.data(), count, 3);
  floats = positions.topRows(count).cast<float>();
  if (!floats.allFinite()) throw std::invalid_argument(where + " has a position that is not finite");
  frames_.push_back(std::move(frame));
}

GltfWriteReport GltfWriter::write(const std::filesystem::path& path) const {
  if (frames_.empty()) throw std::invalid_argument("GltfWriter::write: no frames were added");
  GltfWriteReport report;
  Document document;
  Geometry geometry(asset_, options_.normals, document);
  Draft draft{asset_, options_, frames_, path, bounds(asset_.mesh).diagonal(), document, geometry};
  if (options_.kind == GltfKind::pca) {
    write_pca(draft, report);
  } else {
    write_exact(draft, report);
  }
  report.bytes =
      write_glb(path, document.text(options_.animation_name, geometry.appearance()), document.binary);
  warn(asset_, report);
  return report;
}

}  // namespace sinew
