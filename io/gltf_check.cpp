// Rules after the glTF 2.0 specification, chapters 3 and 5; the checks a reader needs to be safe, and
// those whose breach would leave it open what the file means.
#include "io/gltf_check.h"

#include <algorithm>
#include <array>
#include <set>
#include <string_view>
#include <utility>

#include "io/file_error.h"

namespace sinew {
namespace {

/// An accessor without a buffer view is all zeros: the only one whose size the file's own size does
/// not bound. 64 MiB is a five-million-vertex array of float triples.
constexpr std::uint64_t kMostZeroBytes = std::uint64_t{64} << 20;

std::size_t count_of(const JsonPlace& root, const char* key) {
  return root.has(key) ? root.member(key).array_size() : 0;
}

/// Elements of any one array. An empty object in the file becomes about a kilobyte here.
constexpr std::size_t kMostElements = 300'000;

/// offset + length <= size, without the sum.
bool fits(std::uint64_t offset, std::uint64_t length, std::uint64_t size) {
  return offset <= size && length <= size - offset;
}

/// Calls check(place, index) for every element of an optional top-level array of objects.
template <class Check>
void for_each(const JsonPlace& root, const char* key, Check check) {
  const std::size_t count = count_of(root, key);
  if (count > kMostElements) {
    throw FileError(
        FileFault::resource, root.member(key).where(),
        "has " + std::to_string(count) + " elements; at most " + std::to_string(kMostElements) + " are read");
  }
  for (std::size_t i = 0; i < count; ++i) {
    const JsonPlace place = root.member(key).element(i);
    place.expect_object();
    if (const auto name = place.find("name")) name->text();
    check(place, i);
  }
}

// ---- asset and extensions

void check_version(const JsonPlace& root) {
  const JsonPlace version = root.member("asset").member("version");
  if (version.text().rfind("2.", 0) != 0) {
    throw FileError(FileFault::unusable, version.where(),
                    "glTF version '" + version.text() + "'; expected 2.0");
  }
  const auto least = root.member("asset").find("minVersion");
  if (least && least->text() != "2.0") {
    throw FileError(FileFault::unusable, least->where(),
                    "needs glTF version '" + least->text() + "'; expected 2.0");
  }
}

/// Extensions that change only how a surface looks, or add things we do not draw, may be required
/// without harm; of those that change geometry we know quantization.
bool can_do_without(const std::string& extension) {
  constexpr std::array<std::string_view, 9> kKnown = {
      "KHR_mesh_quantization", "KHR_texture_transform", "KHR_texture_basisu",
      "EXT_texture_webp",      "EXT_texture_avif",      "MSFT_texture_dds",
      "KHR_lights_punctual",   "KHR_xmp_json_ld",       "KHR_animation_pointer"};
  return extension.starts_with("KHR_materials_") ||
         std::find(kKnown.begin(), kKnown.end(), extension) != kKnown.end();
}

void check_extensions(const JsonPlace& root) {
  for (const char* key : {"extensionsUsed", "extensionsRequired"}) {
    for (std::size_t i = 0; i < count_of(root, key); ++i) root.member(key).element(i).text();
  }
  for (std::size_t i = 0; i < count_of(root, "extensionsRequired"); ++i) {
    const JsonPlace extension = root.member("extensionsRequired").element(i);
    if (can_do_without(extension.text())) continue;
    throw FileError(FileFault::unusable, extension.where(),
                    "needs the extension '" + extension.text() + "', which is not supported");
  }
}

// ---- buffers, views, accessors

void check_buffers(const JsonPlace& root, bool has_binary, std::uint64_t binary_size) {
  for_each(root, "buffers", [&](const JsonPlace& buffer, std::size_t i) {
    const std::uint64_t length = buffer.member("byteLength").whole_number();
    if (length == 0) buffer.member("byteLength").fail("found 0, expected 1 or more");
    if (buffer.has("uri")) {
      buffer.member("uri").text();
    } else if (i != 0 || !has_binary) {
      buffer.fail("has no uri, and the file has no binary chunk for it");
    } else if (length > binary_size) {
      buffer.member("byteLength")
          .fail("found " + std::to_string(length) + "; the binary chunk has " + std::to_string(binary_size) +
                " bytes");
    }
  });
}

void check_views(const JsonPlace& root) {
  for_each(root, "bufferViews", [&](const JsonPlace& view, std::size_t) {
    const int buffer = view.member("buffer").index_below(count_of(root, "buffers"), "buffers");
    const std::uint64_t size = root.member("buffers").element(buffer).member("byteLength").whole_number();
    const std::uint64_t offset = view.whole_number_or("byteOffset", 0);
    const std::uint64_t length = view.member("byteLength").whole_number();
    if (length == 0) view.member("byteLength").fail("found 0, expected 1 or more");
    if (!fits(offset, length, size)) {
      view.fail("bytes " + std::to_string(offset) + " and " + std::to_string(length) + " more; buffer " +
                std::to_string(buffer) + " has " + std::to_string(size));
    }
    const std::uint64_t stride = view.whole_number_or("byteStride", 4);
    if (stride < 4 || stride > 252 || stride % 4 != 0) {
      view.member("byteStride")
          .fail("found " + std::to_string(stride) + ", expected a multiple of 4 from 4 to 252");
    }
  });
}

/// Fails unless `count` elements of `size` bytes, `stride` apart from `offset` on, lie in a view.
void check_range(const JsonPlace& place, const JsonPlace& view, std::uint64_t offset, std::uint64_t count,
                 std::uint64_t size, std::uint64_t stride) {
  const std::uint64_t length = view.member("byteLength").whole_number();
  const bool inside = fits(offset, size, length) && (count - 1) <= (length - offset - size) / stride;
  if (!inside) {
    place.fail(std::to_string(count) + " elements of " + std::to_string(size) + " bytes from byte " +
               std::to_string(offset) + " do not fit the " + std::to_string(length) + " bytes of " +
               view.where());
  }
}

void check_sparse(const JsonPlace& root, const JsonPlace& sparse, std::uint64_t elements,
                  std::uint64_t size) {
  const std::size_t views = count_of(root, "bufferViews");
  const std::uint64_t count = sparse.member("count").whole_number();
  if (count == 0 || count > elements) {
    sparse.member("count").fail("found " + std::to_string(count) + ", expected 1 to " +
                                std::to_string(elements));
  }
  const JsonPlace indices = sparse.member("indices");
  const JsonPlace values = sparse.member("values");
  const std::uint64_t type = indices.member("componentType").whole_number();
  if (type != 5121 && type != 5123 && type != 5125) {
    indices.member("componentType").fail("found " + std::to_string(type) + ", expected 5121, 5123 or 5125");
  }
  const auto view_of = [&](const JsonPlace& place) {
    return root.member("bufferViews").element(place.member("bufferView").index_below(views, "buffer views"));
  };
  const std::uint64_t index_size = component_size(type);
  check_range(indices, view_of(indices), indices.whole_number_or("byteOffset", 0), count, index_size,
              index_size);
  check_range(values, view_of(values), values.whole_number_or("byteOffset", 0), count, size, size);
}

/// Columns of small matrices start at multiples of four bytes; glTF 2.0, 3.6.2.4.
std::uint64_t element_size(const std::string& type, std::uint64_t component) {
  if (type == "MAT2" && component == 1) return 8;
  if (type == "MAT3" && component <= 2) return component == 1 ? 12 : 24;
  return component * component_count(type);
}

void check_accessors(const JsonPlace& root) {
  for_each(root, "accessors", [&](const JsonPlace& accessor, std::size_t) {
    const std::uint64_t type = accessor.member("componentType").whole_number();
    const std::uint64_t component = component_size(type);
    if (component == 0)
      accessor.member("componentType").fail("found " + std::to_string(type) + ", not a glTF type");
    const std::string& shape = accessor.member("type").text();
    if (component_count(shape) == 0) accessor.member("type").fail("found '" + shape + "', not a glTF type");
    if (const auto flag = accessor.find("normalized"); flag && !flag->value().is_boolean()) {
      flag->fail(std::string("found ") + flag->value().type_name() + ", expected true or false");
    }
    const std::uint64_t count = accessor.member("count").whole_number();
    if (count == 0) accessor.member("count").fail("found 0, expected 1 or more");
    const std::uint64_t size = element_size(shape, component);
    const std::uint64_t offset = accessor.whole_number_or("byteOffset", 0);
    const int view = accessor.index_or_none("bufferView", count_of(root, "bufferViews"), "buffer views");
    if (view >= 0) {
      const JsonPlace place = root.member("bufferViews").element(view);
      const std::uint64_t stride = place.whole_number_or("byteStride", size);
      if (stride < size) {
        accessor.fail("elements of " + std::to_string(size) + " bytes in a view with byteStride " +
                      std::to_string(stride));
      }
      check_range(accessor, place, offset, count, size, stride);
    } else if (count > kMostZeroBytes / size) {
      throw FileError(FileFault::resource, accessor.where(),
                      std::to_string(count) + " elements without a buffer view; at most " +
                          std::to_string(kMostZeroBytes) + " zero bytes are made");
    }
    if (const auto sparse = accessor.find("sparse")) check_sparse(root, *sparse, count, size);
  });
}

// ---- meshes, nodes, scenes, skins

/// The accessor a place refers to, if its shape is the one wanted and its type one of those wanted.
JsonPlace accessor_of(const JsonPlace& root, const JsonPlace& reference, const char* shape,
                      std::initializer_list<std::uint64_t> types, const char* what) {
  const JsonPlace accessor =
      root.member("accessors").element(reference.index_below(count_of(root, "accessors"), "accessors"));
  const std::uint64_t type = accessor.member("componentType").whole_number();
  const std::string& found = accessor.member("type").text();
  if (found != shape || std::find(types.begin(), types.end(), type) == types.end()) {
    reference.fail("accessor is " + found + " of type " + std::to_string(type) + "; expected " + what);
  }
  return accessor;
}

void check_attributes(const JsonPlace& root, const JsonPlace& primitive) {
  const JsonPlace attributes = primitive.member("attributes");
  attributes.expect_object();
  for (const auto& [name, unused] : attributes.value().items()) {
    const JsonPlace reference = attributes.member(name);
    reference.index_below(count_of(root, "accessors"), "accessors");
    if (name == "POSITION") {
      accessor_of(root, reference, "VEC3", {5120, 5121, 5122, 5123, 5126}, "VEC3 of floats or quantized");
    } else if (name == "NORMAL") {
      accessor_of(root, reference, "VEC3", {5120, 5122, 5126}, "VEC3 of floats or quantized");
    } else if (name == "TANGENT") {
      accessor_of(root, reference, "VEC4", {5120, 5122, 5126}, "VEC4 of floats or quantized");
    } else if (name.starts_with("JOINTS_")) {
      accessor_of(root, reference, "VEC4", {5121, 5123}, "VEC4 of unsigned bytes or shorts");
    } else if (name.starts_with("WEIGHTS_")) {
      accessor_of(root, reference, "VEC4", {5121, 5123, 5126}, "VEC4 of floats, unsigned bytes or shorts");
    }
  }
}

void check_attribute_counts(const JsonPlace& root, const JsonPlace& primitive) {
  const JsonPlace attributes = primitive.member("attributes");
  const auto elements_of = [&](const std::string& name) {
    return root.member("accessors")
        .element(attributes.member(name).whole_number())
        .member("count")
        .whole_number();
  };
  if (!attributes.has("POSITION")) return;
  const std::uint64_t vertices = elements_of("POSITION");
  for (const auto& [name, unused] : attributes.value().items()) {
    if (elements_of(name) == vertices) continue;
    attributes.member(name).fail("accessor has " + std::to_string(elements_of(name)) +
                                 " elements; POSITION has " + std::to_string(vertices));
  }
}

void check_meshes(const JsonPlace& root) {
  for_each(root, "meshes", [&](const JsonPlace& mesh, std::size_t) {
    const JsonPlace primitives = mesh.member("primitives");
    for (std::size_t i = 0; i < primitives.array_size(); ++i) {
      const JsonPlace primitive = primitives.element(i);
      check_attributes(root, primitive);
      check_attribute_counts(root, primitive);
      const std::uint64_t mode = primitive.whole_number_or("mode", 4);
      if (mode > 6) primitive.member("mode").fail("found " + std::to_string(mode) + ", expected 0 to 6");
      if (const auto indices = primitive.find("indices")) {
        const JsonPlace accessor =
            accessor_of(root, *indices, "SCALAR", {5121, 5123, 5125}, "SCALAR of unsigned integers");
        if (!accessor.has("bufferView")) indices->fail("index accessor has no buffer view");
      }
      primitive.index_or_none("material", count_of(root, "materials"), "materials");
    }
  });
}

/// One parent a node at most, and no way round in a circle. Returns each node's parent, -1 at a root.
std::vector<int> check_tree(const JsonPlace& root) {
  const std::size_t count = count_of(root, "nodes");
  std::vector<int> parent(count, -1);
  for_each(root, "nodes", [&](const JsonPlace& node, std::size_t i) {
    if (!node.has("children")) return;
    const JsonPlace children = node.member("children");
    for (std::size_t k = 0; k < children.array_size(); ++k) {
      const int child = children.element(k).index_below(count, "nodes");
      if (parent[child] >= 0) {
        children.element(k).fail("node " + std::to_string(child) + " already is a child of node " +
                                 std::to_string(parent[child]));
      }
      parent[child] = static_cast<int>(i);
    }
  });
  // Climbing from each node, `seen` remembers in whose climb a node was met: meeting one's own is a circle.
  std::vector<int> seen(count, -1);
  for (int start = 0; start < static_cast<int>(count); ++start) {
    for (int at = start; at >= 0 && seen[at] < 0; at = parent[at]) {
      seen[at] = start;
      const bool circle = parent[at] >= 0 && seen[parent[at]] == start;
      if (circle) root.member("nodes").element(at).fail("is its own ancestor");
    }
  }
  return parent;
}

void check_nodes(const JsonPlace& root) {
  for_each(root, "nodes", [&](const JsonPlace& node, std::size_t) {
    node.index_or_none("mesh", count_of(root, "meshes"), "meshes");
    node.index_or_none("skin", count_of(root, "skins"), "skins");
    constexpr std::array<std::pair<const char*, std::size_t>, 3> kParts = {
        {{"translation", 3}, {"rotation", 4}, {"scale", 3}}};
    for (const auto& [key, size] : kParts) {
      if (!node.has(key)) continue;
      node.member(key).expect_numbers(size);
      if (node.has("matrix"))
        node.fail(std::string("has a matrix and a ") + key + "; expected one or the other");
    }
    if (node.has("matrix")) node.member("matrix").expect_numbers(16);
  });
}

void check_scenes(const JsonPlace& root, const std::vector<int>& parent) {
  for_each(root, "scenes", [&](const JsonPlace& scene, std::size_t) {
    if (!scene.has("nodes")) return;
    const JsonPlace nodes = scene.member("nodes");
    for (std::size_t i = 0; i < nodes.array_size(); ++i) {
      const int node = nodes.element(i).index_below(parent.size(), "nodes");
      if (parent[node] >= 0) nodes.element(i).fail("node " + std::to_string(node) + " is not a root");
    }
  });
  root.index_or_none("scene", count_of(root, "scenes"), "scenes");
}

void check_skins(const JsonPlace& root) {
  for_each(root, "skins", [&](const JsonPlace& skin, std::size_t) {
    const JsonPlace joints = skin.member("joints");
    const std::size_t count = joints.array_size();
    if (count == 0) joints.fail("is empty, expected a joint");
    for (std::size_t i = 0; i < count; ++i) joints.element(i).index_below(count_of(root, "nodes"), "nodes");
    skin.index_or_none("skeleton", count_of(root, "nodes"), "nodes");
    const auto matrices = skin.find("inverseBindMatrices");
    if (!matrices) return;
    const std::uint64_t found =
        accessor_of(root, *matrices, "MAT4", {5126}, "MAT4 of floats").member("count").whole_number();
    if (found < count) {
      matrices->fail("accessor has " + std::to_string(found) + " matrices for " + std::to_string(count) +
                     " joints");
    }
  });
}

// ---- animations

/// The key times must be SCALAR floats, and there must be as many values as the path wants.
void check_sampler(const JsonPlace& root, const JsonPlace& sampler, const std::string& path) {
  const std::uint64_t keys = accessor_of(root, sampler.member("input"), "SCALAR", {5126}, "SCALAR of floats")
                                 .member("count")
                                 .whole_number();
  const std::string how = sampler.text_or("interpolation", "LINEAR");
  if (how != "LINEAR" && how != "STEP" && how != "CUBICSPLINE") {
    sampler.member("interpolation").fail("found '" + how + "', expected LINEAR, STEP or CUBICSPLINE");
  }
  if (path == "weights") return;
  const bool turns = path == "rotation";
  const std::uint64_t values =
      accessor_of(root, sampler.member("output"), turns ? "VEC4" : "VEC3", {5120, 5121, 5122, 5123, 5126},
                  turns ? "VEC4 of floats or normalized integers" : "VEC3 of floats")
          .member("count")
          .whole_number();
  const std::uint64_t a_key = how == "CUBICSPLINE" ? 3 : 1;
  if (values % a_key != 0 || values / a_key != keys) {
    sampler.member("output").fail("accessor has " + std::to_string(values) + " values for " +
                                  std::to_string(keys) + " keys, expected " + std::to_string(a_key) +
                                  " a key");
  }
}

void check_animation(const JsonPlace& root, const JsonPlace& animation) {
  const JsonPlace samplers = animation.member("samplers");
  const JsonPlace channels = animation.member("channels");
  samplers.array_size();
  std::set<std::pair<int, std::string>> targets;
  for (std::size_t i = 0; i < channels.array_size(); ++i) {
    const JsonPlace channel = channels.element(i);
    const JsonPlace sampler =
        samplers.element(channel.member("sampler").index_below(samplers.array_size(), "samplers"));
    const JsonPlace target = channel.member("target");
    const std::string& path = target.member("path").text();
    const int node = target.index_or_none("node", count_of(root, "nodes"), "nodes");
    if (node < 0) continue;  // an extension's target
    if (path != "translation" && path != "rotation" && path != "scale" && path != "weights") {
      target.member("path").fail("found '" + path + "', expected translation, rotation, scale or weights");
    }
    check_sampler(root, sampler, path);
    if (!targets.emplace(node, path).second) {
      target.fail("a second channel for the " + path + " of node " + std::to_string(node));
    }
    if (path != "weights" && root.member("nodes").element(node).has("matrix")) {
      target.fail("moves node " + std::to_string(node) +
                  ", which has a matrix; expected translation, rotation, scale");
    }
  }
}

}  // namespace

int component_size(std::uint64_t component_type) {
  switch (component_type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      return 0;
  }
}

int component_count(const std::string& type) {
  constexpr std::array<std::pair<std::string_view, int>, 7> kTypes = {
      {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}}};
  for (const auto& [name, count] : kTypes) {
    if (type == name) return count;
  }
  return 0;
}

void check_gltf(const JsonPlace& root, bool has_binary, std::uint64_t binary_size) {
  root.expect_object();
  check_version(root);
  check_extensions(root);
  check_buffers(root, has_binary, binary_size);
  check_views(root);
  check_accessors(root);
  check_meshes(root);
  const std::vector<int> parent = check_tree(root);
  check_nodes(root);
  check_scenes(root, parent);
  check_skins(root);
  for_each(root, "animations",
           [&](const JsonPlace& animation, std::size_t) { check_animation(root, animation); });
}

}  // namespace sinew
