#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/gltf_appearance.h"
#include "skeleton/transform.h"

namespace sinew {

// A loaded glTF file, as far as we use it. Every index below is in range, every accessor lies
// inside its buffer: read_gltf_document() has checked. -1 means "none" throughout.

struct GltfView {
  int buffer = 0;
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  std::uint64_t stride = 0;  ///< 0: tightly packed
};

struct GltfSparse {
  std::uint64_t count = 0;
  int index_view = 0;
  std::uint64_t index_offset = 0;
  int index_type = 5125;
  int value_view = 0;
  std::uint64_t value_offset = 0;
};

struct GltfAccessor {
  int view = -1;  ///< -1: all zeros, but for what `sparse` replaces
  std::uint64_t offset = 0;
  std::uint64_t count = 0;
  int component_type = 5126;
  int components = 1;
  bool is_matrix = false;
  bool normalized = false;
  std::optional<GltfSparse> sparse;
};

struct GltfPrimitive {
  int mode = 4;
  int indices = -1;
  int material = -1;
  std::vector<std::pair<std::string, int>> attributes;  ///< semantic, accessor; sorted by semantic

  int attribute(const std::string& name) const;  ///< accessor, or -1
};

struct GltfMesh {
  std::string name;
  std::vector<GltfPrimitive> primitives;
};

struct GltfNode {
  std::string name;
  int parent = -1;
  std::vector<int> children;
  int mesh = -1;
  int skin = -1;
  Transform rest;                              ///< of a node with a matrix: its decomposition
  std::optional<Eigen::Affine3d> rest_matrix;  ///< of a node with a matrix: the matrix itself
};

struct GltfSkin {
  std::string name;
  std::vector<int> joints;  ///< nodes; one may be listed twice
  int inverse_bind = -1;    ///< accessor; -1: identities
};

enum class GltfInterpolation { linear, step, cubic };
enum class GltfPath { translation, rotation, scale, weights };

struct GltfSampler {
  int input = -1;
  int output = -1;
  GltfInterpolation interpolation = GltfInterpolation::linear;
};

struct GltfChannel {
  int sampler = 0;
  int node = 0;
  GltfPath path = GltfPath::translation;
};

struct GltfAnimation {
  std::string name;
  std::vector<GltfSampler> samplers;
  std::vector<GltfChannel> channels;
};

struct GltfDocument {
  std::string file;  ///< for messages
  std::filesystem::path path;
  bool is_glb = false;
  std::vector<std::vector<unsigned char>> buffers;
  std::vector<GltfView> views;
  std::vector<GltfAccessor> accessors;
  std::vector<GltfMesh> meshes;
  std::vector<GltfNode> nodes;
  std::vector<int> node_order;   ///< all nodes, parents before children
  std::vector<int> scene_order;  ///< the default scene's nodes likewise; all nodes when there is no scene
  std::vector<GltfSkin> skins;
  std::vector<GltfAnimation> animations;
  GltfAppearance appearance;
  std::vector<std::string> warnings;

  /// FILE:/kind/index, for messages.
  std::string where(const char* kind, std::size_t index) const {
    return file + ":/" + kind + "/" + std::to_string(index);
  }
};

/// Loads and checks a file. Throws FileError; opens nothing outside the file's own folder.
GltfDocument read_gltf_document(const std::filesystem::path& path);

/// An accessor's elements as numbers, count x components, row by row; normalized integers become
/// [0, 1] or [-1, 1]. Throws FileError at the first that is not finite.
std::vector<double> read_numbers(const GltfDocument& document, int accessor);

/// The last of an accessor's numbers, without reading the others.
double read_last_number(const GltfDocument& document, int accessor);

/// An accessor's elements as whole numbers (unsigned component types only), count x components.
std::vector<std::uint32_t> read_whole_numbers(const GltfDocument& document, int accessor);

/// An accessor's elements as they are stored, tightly packed, sparse values put in.
std::vector<std::byte> read_packed(const GltfDocument& document, int accessor);

}  // namespace sinew
