#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sinew {

/// A glTF file's bytes and where its JSON text and its binary chunk lie in them.
struct GltfContainer {
  std::vector<std::byte> bytes;
  std::size_t json_offset = 0;
  std::size_t json_size = 0;
  std::size_t binary_offset = 0;
  std::size_t binary_size = 0;
  bool is_glb = false;
  bool has_binary = false;  ///< a GLB with a BIN chunk

  std::string_view json() const {
    return {reinterpret_cast<const char*>(bytes.data()) + json_offset, json_size};
  }
  std::span<const std::byte> binary() const { return {bytes.data() + binary_offset, binary_size}; }
};

/// Reads a .gltf or .glb, told apart by their first bytes, and checks the GLB's header and chunk
/// lengths. Files over 1 GiB are a resource fault. Throws FileError.
GltfContainer read_gltf_container(const std::filesystem::path& path);

/// The same from memory; `path` stands for the file in messages.
GltfContainer parse_gltf_container(std::vector<std::byte> bytes, const std::filesystem::path& path);

/// One pass over JSON text before any parser sees it: brackets nested deeper than 64 are malformed
/// (parsers recurse), more than 4 million values a resource fault (each costs a parser 16 bytes or more).
/// Does not say that the text is JSON. Throws FileError.
void check_json_bounds(std::string_view json, const std::string& where);

}  // namespace sinew
