// The only file that includes tiny_gltf.h. tinygltf trusts its input: it reads past the end of some
// GLBs, follows uris anywhere and checks next to no index (its 2.7.0). So it is handed only what
// check_gltf() has passed, without images, extensions and extras, and each buffer's bytes come from
// memory. It never opens a file.
#include "io/gltf_document.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>  // tiny_gltf.h forgets it when it is told to stay away from files
#include <new>

#include "io/file_error.h"
#include "io/gltf_check.h"
#include "io/gltf_container.h"
#include "io/gltf_folder.h"
#include "io/gltf_json.h"

#define TINYGLTF_IMPLEMENTATION
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#include <tiny_gltf.h>

namespace sinew {
namespace {

using nlohmann::json;

/// Of all buffers together; a file may name the same bytes many times.
constexpr std::uint64_t kMostBufferBytes = std::uint64_t{2} << 30;

/// A matrix whose polar factor's remainder has off-diagonal parts above this share of its size is sheared.
constexpr double kShear = 1e-3;

json parse_json(const GltfContainer& container, const std::string& file) {
  try {
    return json::parse(container.json());
  } catch (const json::parse_error& error) {
    throw FileError(FileFault::malformed, file + "@" + std::to_string(container.json_offset + error.byte),
                    "not JSON from here on");
  } catch (const json::exception&) {
    throw FileError(FileFault::malformed, file, "JSON has a number too large to read");
  }
}

// ---- what tinygltf is given

void copy_members(const json& from, json& to, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (const auto found = from.find(key); found != from.end()) to[key] = *found;
  }
}

/// A copy of one top-level array, each object reduced to `keys`.
void copy_array(const json& root, json& to, const char* name, std::initializer_list<const char*> keys) {
  const auto found = root.find(name);
  if (found == root.end()) return;
  json& array = to[name] = json::array();
  for (const json& element : *found) {
    json copy = json::object();
    copy_members(element, copy, keys);
    array.push_back(std::move(copy));
  }
}

void copy_meshes(const json& root, json& to) {
  copy_array(root, to, "meshes", {"name", "primitives"});
  if (!to.contains("meshes")) return;
  for (json& mesh : to["meshes"]) {
    for (json& primitive : mesh["primitives"]) {
      json copy = json::object();
      copy_members(primitive, copy, {"attributes", "indices", "material", "mode"});
      primitive = std::move(copy);
    }
  }
}

/// Leaves out channels without a node (some extension's targets) and says whether there were any.
bool copy_animations(const json& root, json& to) {
  bool left_out = false;
  const auto found = root.find("animations");
  if (found == root.end()) return left_out;
  json& animations = to["animations"] = json::array();
  for (const json& animation : *found) {
    json copy = json::object();
    copy_members(animation, copy, {"name"});
    copy["samplers"] = copy["channels"] = json::array();
    for (const json& sampler : animation["samplers"]) {
      json kept = json::object();
      copy_members(sampler, kept, {"input", "output", "interpolation"});
      copy["samplers"].push_back(std::move(kept));
    }
    for (const json& channel : animation["channels"]) {
      if (!channel["target"].contains("node")) {
        left_out = true;
        continue;
      }
      json kept = {{"sampler", channel["sampler"]}, {"target", json::object()}};
      copy_members(channel["target"], kept["target"], {"node", "path"});
      copy["channels"].push_back(std::move(kept));
    }
    animations.push_back(std::move(copy));
  }
  return left_out;
}

json reduced(const json& root, GltfDocument& document) {
  json to = {{"asset", {{"version", "2.0"}}}};
  copy_array(root, to, "buffers", {"byteLength"});
  if (to.contains("buffers")) {
    for (std::size_t i = 0; i < to["buffers"].size(); ++i) to["buffers"][i]["uri"] = std::to_string(i);
  }
  copy_array(root, to, "bufferViews", {"buffer", "byteOffset", "byteLength", "byteStride"});
  copy_array(root, to, "accessors",
             {"bufferView", "byteOffset", "componentType", "normalized", "count", "type", "sparse"});
  copy_meshes(root, to);
  copy_array(root, to, "nodes",
             {"name", "children", "mesh", "skin", "matrix", "translation", "rotation", "scale"});
  copy_array(root, to, "scenes", {"nodes"});
  copy_members(root, to, {"scene"});
  copy_array(root, to, "skins", {"name", "joints", "inverseBindMatrices"});
  if (copy_animations(root, to)) {
    document.warnings.push_back("W_GLTF_CHANNEL: animation channels without a target node are ignored");
  }
  return to;
}

using Bytes = std::vector<unsigned char>;

Bytes as_unsigned(std::span<const std::byte> bytes) {
  Bytes result(bytes.size());
  if (!bytes.empty()) std::memcpy(result.data(), bytes.data(), bytes.size());
  return result;
}

Bytes read_buffer(const JsonPlace& buffer, const GltfContainer& container, const AssetFolder& folder) {
  const std::uint64_t length = buffer.member("byteLength").whole_number();
  const auto uri = buffer.find("uri");
  if (!uri) return as_unsigned(container.binary().first(length));
  if (!is_data_uri(uri->text())) return as_unsigned(folder.read_exactly(uri->text(), length, uri->where()));
  const DataUri data = decode_data_uri(uri->text(), uri->where());
  if (data.bytes.size() < length) {
    uri->fail("data uri has " + std::to_string(data.bytes.size()) + " bytes; expected " +
              std::to_string(length));
  }
  return as_unsigned(std::span(data.bytes).first(length));
}

std::vector<Bytes> read_buffers(const JsonPlace& root, const GltfContainer& container,
                                const AssetFolder& folder) {
  std::vector<Bytes> buffers;
  if (!root.has("buffers")) return buffers;
  const JsonPlace array = root.member("buffers");
  std::uint64_t total = 0;
  for (std::size_t i = 0; i < array.array_size(); ++i) {
    const std::uint64_t length = array.element(i).member("byteLength").whole_number();
    if (length > kMostBufferBytes - total) {
      throw FileError(FileFault::resource, array.where(),
                      "buffers have more than " + std::to_string(kMostBufferBytes) + " bytes together");
    }
    total += length;
    buffers.push_back(read_buffer(array.element(i), container, folder));
  }
  return buffers;
}

/// tinygltf's door to the file system leads to `buffers`: its file names are our buffer numbers.
tinygltf::FsCallbacks served_from(std::vector<Bytes>& buffers) {
  tinygltf::FsCallbacks callbacks{};
  callbacks.user_data = &buffers;
  callbacks.FileExists = [](const std::string&, void*) { return true; };
  callbacks.ExpandFilePath = [](const std::string& name, void*) { return name; };
  callbacks.ReadWholeFile = [](Bytes* out, std::string*, const std::string& name, void* served) {
    *out = std::move((*static_cast<std::vector<Bytes>*>(served))[std::stoul(name)]);
    return true;
  };
  callbacks.WriteWholeFile = [](std::string*, const std::string&, const Bytes&, void*) { return false; };
  return callbacks;
}

tinygltf::Model load_model(const json& reduced_root, std::vector<Bytes>& buffers, const std::string& file) {
  const std::string text = reduced_root.dump();
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks(served_from(buffers));
  tinygltf::Model model;
  std::string error, warning;
  const bool loaded = loader.LoadASCIIFromString(&model, &error, &warning, text.c_str(),
                                                 static_cast<unsigned>(text.size()), "");
  if (!loaded) {
    std::replace(error.begin(), error.end(), '\n', ' ');
    throw FileError(FileFault::malformed, file, "cannot be loaded: " + error);
  }
  return model;
}

// ---- what we take from tinygltf

GltfAccessor accessor_from(const tinygltf::Accessor& from) {
  GltfAccessor to;
  to.view = from.bufferView;
  to.offset = from.byteOffset;
  to.count = from.count;
  to.component_type = from.componentType;
  to.components = tinygltf::GetNumComponentsInType(static_cast<std::uint32_t>(from.type));
  to.is_matrix =
      from.type == TINYGLTF_TYPE_MAT2 || from.type == TINYGLTF_TYPE_MAT3 || from.type == TINYGLTF_TYPE_MAT4;
  to.normalized = from.normalized;
  if (from.sparse.isSparse) {
    to.sparse = GltfSparse{static_cast<std::uint64_t>(from.sparse.count),
                           from.sparse.indices.bufferView,
                           static_cast<std::uint64_t>(from.sparse.indices.byteOffset),
                           from.sparse.indices.componentType,
                           from.sparse.values.bufferView,
                           static_cast<std::uint64_t>(from.sparse.values.byteOffset)};
  }
  return to;
}

GltfMesh mesh_from(const tinygltf::Mesh& from) {
  GltfMesh to;
  to.name = from.name;
  for (const tinygltf::Primitive& primitive : from.primitives) {
    to.primitives.push_back({primitive.mode < 0 ? 4 : primitive.mode,
                             primitive.indices,
                             primitive.material,
                             {primitive.attributes.begin(), primitive.attributes.end()}});
  }
  return to;
}

/// Rotation and scale of a node's matrix; true when it is neither, but a shear.
bool decompose(const Eigen::Affine3d& matrix, Transform& to) {
  to.translation = matrix.translation();
  to.rotation = nearest_rotation(matrix.linear());
  const Eigen::Matrix3d stretch = to.rotation.toRotationMatrix().transpose() * matrix.linear();
  to.scale = stretch.diagonal();
  const Eigen::Matrix3d off = stretch - Eigen::Matrix3d(to.scale.asDiagonal());
  return off.norm() > kShear * stretch.norm();
}

GltfNode node_from(const tinygltf::Node& from, const std::string& where, bool& sheared) {
  GltfNode to;
  to.name = from.name;
  to.children = from.children;
  to.mesh = from.mesh;
  to.skin = from.skin;
  if (!from.matrix.empty()) {
    const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix4d>(from.matrix.data());
    if ((matrix.row(3) - Eigen::RowVector4d::UnitW()).norm() > 1e-4) {
      throw FileError(FileFault::malformed, where + "/matrix", "the last row is not 0 0 0 1");
    }
    to.rest_matrix = Eigen::Affine3d::Identity();
    to.rest_matrix->matrix().topRows<3>() = matrix.topRows<3>();
    sheared = decompose(*to.rest_matrix, to.rest) || sheared;
    return to;
  }
  if (!from.translation.empty())
    to.rest.translation = Eigen::Map<const Eigen::Vector3d>(from.translation.data());
  if (!from.scale.empty()) to.rest.scale = Eigen::Map<const Eigen::Vector3d>(from.scale.data());
  if (!from.rotation.empty()) {
    const Eigen::Vector4d xyzw = Eigen::Map<const Eigen::Vector4d>(from.rotation.data());
    if (!(xyzw.norm() > 1e-6))
      throw FileError(FileFault::malformed, where + "/rotation", "quaternion has no length");
    to.rest.rotation.coeffs() = xyzw.normalized();
  }
  return to;
}

GltfInterpolation interpolation_from(const std::string& name) {
  if (name == "STEP") return GltfInterpolation::step;
  return name == "CUBICSPLINE" ? GltfInterpolation::cubic : GltfInterpolation::linear;
}

GltfPath path_from(const std::string& name) {
  if (name == "translation") return GltfPath::translation;
  if (name == "rotation") return GltfPath::rotation;
  return name == "scale" ? GltfPath::scale : GltfPath::weights;
}

GltfAnimation animation_from(const tinygltf::Animation& from) {
  GltfAnimation to;
  to.name = from.name;
  for (const tinygltf::AnimationSampler& sampler : from.samplers) {
    to.samplers.push_back({sampler.input, sampler.output, interpolation_from(sampler.interpolation)});
  }
  for (const tinygltf::AnimationChannel& channel : from.channels) {
    to.channels.push_back({channel.sampler, channel.target_node, path_from(channel.target_path)});
  }
  return to;
}

/// Depth first, children in the file's order. With a stack of our own: trees may be deep.
std::vector<int> parents_first(const std::vector<GltfNode>& nodes, const std::vector<int>& roots) {
  std::vector<int> order;
  std::vector<int> waiting(roots.rbegin(), roots.rend());
  while (!waiting.empty()) {
    const int node = waiting.back();
    waiting.pop_back();
    order.push_back(node);
    waiting.insert(waiting.end(), nodes[node].children.rbegin(), nodes[node].children.rend());
  }
  return order;
}

void link_nodes(GltfDocument& document, const tinygltf::Model& model) {
  std::vector<GltfNode>& nodes = document.nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    for (const int child : nodes[i].children) nodes[child].parent = static_cast<int>(i);
  }
  std::vector<int> roots;
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (nodes[i].parent < 0) roots.push_back(static_cast<int>(i));
  }
  document.node_order = parents_first(nodes, roots);
  if (!model.scenes.empty()) {
    roots = model.scenes[std::max(model.defaultScene, 0)].nodes;
    std::vector<bool> met(nodes.size(), false);  // a scene may list a root twice; it is there once
    std::erase_if(roots, [&](int root) { return met[root] || (met[root] = true, false); });
  }
  document.scene_order = parents_first(nodes, roots);
}

void take_over(tinygltf::Model& model, GltfDocument& document) {
  for (tinygltf::Buffer& buffer : model.buffers) document.buffers.push_back(std::move(buffer.data));
  for (const tinygltf::BufferView& view : model.bufferViews) {
    document.views.push_back({view.buffer, view.byteOffset, view.byteLength, view.byteStride});
  }
  for (const tinygltf::Accessor& accessor : model.accessors)
    document.accessors.push_back(accessor_from(accessor));
  for (const tinygltf::Mesh& mesh : model.meshes) document.meshes.push_back(mesh_from(mesh));
  bool sheared = false;
  for (std::size_t i = 0; i < model.nodes.size(); ++i) {
    document.nodes.push_back(node_from(model.nodes[i], document.where("nodes", i), sheared));
  }
  if (sheared) {
    document.warnings.push_back(
        "W_GLTF_SHEAR: a node's matrix has shear, which a clip of this file leaves out");
  }
  for (const tinygltf::Skin& skin : model.skins) {
    document.skins.push_back({skin.name, skin.joints, skin.inverseBindMatrices});
  }
  for (const tinygltf::Animation& animation : model.animations) {
    document.animations.push_back(animation_from(animation));
  }
  link_nodes(document, model);
}

GltfDocument load(const std::filesystem::path& path) {
  GltfDocument document;
  document.path = path;
  document.file = path.string();
  const GltfContainer container = read_gltf_container(path);
  document.is_glb = container.is_glb;
  const json whole = parse_json(container, document.file);
  const JsonPlace root(document.file, whole);
  check_gltf(root, container.has_binary, container.binary_size);
  const AssetFolder folder(path.parent_path());
  std::vector<Bytes> buffers = read_buffers(root, container, folder);
  tinygltf::Model model = load_model(reduced(whole, document), buffers, document.file);
  take_over(model, document);
  document.appearance = read_gltf_appearance(root, folder, [&](int index) {
    const GltfView& view = document.views[index];
    return std::as_bytes(std::span(document.buffers[view.buffer])).subspan(view.offset, view.length);
  });
  document.warnings.insert(document.warnings.end(), document.appearance.warnings.begin(),
                           document.appearance.warnings.end());
  return document;
}

// ---- reading accessors

template <class Number>
Number read_as(const std::byte* from) {
  Number number;
  std::memcpy(&number, from, sizeof number);
  return number;
}

std::uint32_t whole_number_at(const std::byte* from, int component_type) {
  switch (component_type) {
    case 5121:
      return read_as<std::uint8_t>(from);
    case 5123:
      return read_as<std::uint16_t>(from);
    default:
      return read_as<std::uint32_t>(from);
  }
}

/// Normalized integers after glTF 2.0, section 3.6.2.2.
double number_at(const std::byte* from, int component_type, bool normalized) {
  switch (component_type) {
    case 5120:
      return normalized ? std::max(read_as<std::int8_t>(from) / 127.0, -1.0) : read_as<std::int8_t>(from);
    case 5121:
      return read_as<std::uint8_t>(from) / (normalized ? 255.0 : 1.0);
    case 5122:
      return normalized ? std::max(read_as<std::int16_t>(from) / 32767.0, -1.0) : read_as<std::int16_t>(from);
    case 5123:
      return read_as<std::uint16_t>(from) / (normalized ? 65535.0 : 1.0);
    case 5125:
      return read_as<std::uint32_t>(from);
    default:
      return static_cast<double>(read_as<float>(from));
  }
}

const std::byte* view_data(const GltfDocument& document, int view) {
  const GltfView& of = document.views[view];
  return reinterpret_cast<const std::byte*>(document.buffers[of.buffer].data()) + of.offset;
}

void put_sparse_values(const GltfDocument& document, int index, std::size_t size,
                       std::vector<std::byte>& packed) {
  const GltfAccessor& accessor = document.accessors[index];
  const GltfSparse& sparse = *accessor.sparse;
  const std::byte* indices = view_data(document, sparse.index_view) + sparse.index_offset;
  const std::byte* values = view_data(document, sparse.value_view) + sparse.value_offset;
  const auto index_size = static_cast<std::size_t>(component_size(sparse.index_type));
  for (std::uint64_t i = 0; i < sparse.count; ++i) {
    const std::uint32_t element = whole_number_at(indices + i * index_size, sparse.index_type);
    if (element >= accessor.count) {
      throw FileError(FileFault::malformed, document.where("accessors", index) + "/sparse/indices",
                      "index " + std::to_string(element) + " is out of range; the accessor has " +
                          std::to_string(accessor.count) + " elements");
    }
    std::memcpy(packed.data() + element * size, values + i * size, size);
  }
}

std::size_t element_size(const GltfAccessor& accessor) {
  return static_cast<std::size_t>(component_size(accessor.component_type)) * accessor.components;
}

std::size_t stride_of(const GltfDocument& document, const GltfAccessor& accessor) {
  const std::size_t declared = document.views[accessor.view].stride;
  return declared > 0 ? declared : element_size(accessor);
}

}  // namespace

int GltfPrimitive::attribute(const std::string& name) const {
  for (const auto& [semantic, accessor] : attributes) {
    if (semantic == name) return accessor;
  }
  return -1;
}

GltfDocument read_gltf_document(const std::filesystem::path& path) {
  try {
    return load(path);
  } catch (const FileError&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw FileError(FileFault::resource, path.string(), "does not fit into memory");
  } catch (const std::exception& error) {  // whatever a library throws on input it did not expect
    throw FileError(FileFault::malformed, path.string(), std::string("cannot be loaded: ") + error.what());
  }
}

std::vector<std::byte> read_packed(const GltfDocument& document, int index) {
  const GltfAccessor& accessor = document.accessors[index];
  const std::size_t size = element_size(accessor);
  std::vector<std::byte> packed(accessor.count * size);
  if (accessor.view >= 0) {
    const std::size_t stride = stride_of(document, accessor);
    const std::byte* data = view_data(document, accessor.view) + accessor.offset;
    for (std::uint64_t i = 0; i < accessor.count; ++i)
      std::memcpy(packed.data() + i * size, data + i * stride, size);
  }
  if (accessor.sparse) put_sparse_values(document, index, size, packed);
  return packed;
}

std::vector<double> read_numbers(const GltfDocument& document, int index) {
  const GltfAccessor& accessor = document.accessors[index];
  const std::vector<std::byte> packed = read_packed(document, index);
  const auto size = static_cast<std::size_t>(component_size(accessor.component_type));
  std::vector<double> numbers(packed.size() / size);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = number_at(packed.data() + i * size, accessor.component_type, accessor.normalized);
    if (!std::isfinite(numbers[i])) {
      throw FileError(FileFault::malformed, document.where("accessors", index),
                      "element " + std::to_string(i / accessor.components) + " is not finite");
    }
  }
  return numbers;
}

double read_last_number(const GltfDocument& document, int index) {
  const GltfAccessor& accessor = document.accessors[index];
  if (accessor.view < 0 || accessor.sparse) return read_numbers(document, index).back();
  const std::size_t stride = stride_of(document, accessor);
  const std::size_t last = element_size(accessor) - component_size(accessor.component_type);
  const std::byte* from =
      view_data(document, accessor.view) + accessor.offset + (accessor.count - 1) * stride + last;
  const double number = number_at(from, accessor.component_type, accessor.normalized);
  if (!std::isfinite(number)) {
    throw FileError(FileFault::malformed, document.where("accessors", index),
                    "the last element is not finite");
  }
  return number;
}

std::vector<std::uint32_t> read_whole_numbers(const GltfDocument& document, int index) {
  const GltfAccessor& accessor = document.accessors[index];
  const std::vector<std::byte> packed = read_packed(document, index);
  const auto size = static_cast<std::size_t>(component_size(accessor.component_type));
  std::vector<std::uint32_t> numbers(packed.size() / size);
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    numbers[i] = whole_number_at(packed.data() + i * size, accessor.component_type);
  }
  return numbers;
}

}  // namespace sinew
