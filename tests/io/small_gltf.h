#pragma once

// Builds glTF files in memory for tests: JSON to be edited at will and a binary buffer to append to.

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace sinew::small_gltf {

using Json = nlohmann::json;

/// A folder that is gone when the test is over.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "sinew-gltf-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path_); }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path write(const std::string& name, const std::string& bytes) const {
    std::filesystem::remove(path_ / name);  // some file systems sync a file that is truncated and rewritten
    std::ofstream(path_ / name, std::ios::binary) << bytes;
    return path_ / name;
  }

 private:
  std::filesystem::path path_;
};

struct File {
  Json json = {{"asset", {{"version", "2.0"}}}};
  std::string binary;

  /// Appends numbers as an accessor with a view of its own; returns the accessor's index.
  template <class Number>
  int add(const std::string& type, int component_type, const std::vector<Number>& numbers,
          bool normalized = false) {
    binary.resize((binary.size() + 3) / 4 * 4);
    const std::size_t bytes = numbers.size() * sizeof(Number);
    json["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes}});
    binary.append(reinterpret_cast<const char*>(numbers.data()), bytes);
    const std::size_t width = type == "SCALAR" ? 1
                              : type == "MAT4" ? 16
                                               : static_cast<std::size_t>(type[3] - '0');
    json["accessors"].push_back({{"bufferView", json["bufferViews"].size() - 1},
                                 {"componentType", component_type},
                                 {"count", numbers.size() / width},
                                 {"type", type}});
    if (normalized) json["accessors"].back()["normalized"] = true;
    return static_cast<int>(json["accessors"].size()) - 1;
  }
  int add_floats(const std::string& type, const std::vector<float>& numbers) {
    return add(type, 5126, numbers);
  }

  /// Adds a sampler and its channel to an animation.
  void animate(int animation, int node, const std::string& path, const std::vector<float>& times,
               const std::vector<float>& values, const std::string& interpolation = "LINEAR") {
    const int input = add_floats("SCALAR", times);
    const int output = add_floats(path == "rotation" ? "VEC4" : "VEC3", values);
    animate_with(animation, node, path, input, output, interpolation);
  }
  void animate_with(int animation, int node, const std::string& path, int input, int output,
                    const std::string& interpolation = "LINEAR") {
    Json& to = json["animations"][animation];
    to["samplers"].push_back({{"input", input}, {"output", output}, {"interpolation", interpolation}});
    to["channels"].push_back(
        {{"sampler", to["samplers"].size() - 1}, {"target", {{"node", node}, {"path", path}}}});
  }

  std::string glb() const {
    Json whole = json;
    std::string body = binary;
    body.resize((body.size() + 3) / 4 * 4);
    if (!body.empty() && !whole.contains("buffers")) whole["buffers"] = {{{"byteLength", body.size()}}};
    std::string text = whole.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    std::string bytes = "glTF" + word(2) + word(12 + 8 + text.size() + (body.empty() ? 0 : 8 + body.size()));
    bytes += word(text.size()) + "JSON" + text;
    if (!body.empty()) bytes += word(body.size()) + std::string("BIN\0", 4) + body;
    return bytes;
  }

  /// JSON with an external buffer of that name.
  std::string gltf(const std::string& uri) const {
    Json whole = json;
    whole["buffers"] = {{{"byteLength", binary.size()}, {"uri", uri}}};
    return whole.dump();
  }

  static std::string word(std::size_t value) {
    const auto number = static_cast<std::uint32_t>(value);
    std::string bytes(4, '\0');
    std::memcpy(bytes.data(), &number, 4);
    return bytes;
  }
};

/// One triangle, drawn by node 0.
inline File triangle() {
  File file;
  const int position = file.add_floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  file.json["meshes"] = {
      {{"name", "Triangle"}, {"primitives", {{{"attributes", {{"POSITION", position}}}}}}}};
  file.json["nodes"] = {{{"name", "Node"}, {"mesh", 0}}};
  file.json["scenes"] = {{{"nodes", {0}}}};
  file.json["scene"] = 0;
  return file;
}

inline std::vector<float> translation_matrix(float x, float y, float z) {
  return {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, y, z, 1};
}

inline std::vector<float> joined(std::vector<float> first, const std::vector<float>& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

/// A ribbon up the y axis from 0 to 2 (six vertices, two a height), bound to two joints in the bind
/// pose: node 1, "Root", at height 0, and its child node 2, "Tip", at height 1. Node 0 draws it.
/// The middle vertices have half of each joint. No animation.
inline File ribbon() {
  File file;
  const int position = file.add_floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0, 1, 2, 0});
  const int joints = file.add<std::uint8_t>(
      "VEC4", 5121, {0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const int weights = file.add_floats(
      "VEC4", {1, 0, 0, 0, 1, 0, 0, 0, .5f, .5f, 0, 0, .5f, .5f, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0});
  const int indices = file.add<std::uint16_t>("SCALAR", 5123, {0, 1, 2, 2, 1, 3, 2, 3, 4, 4, 3, 5});
  const int bind = file.add_floats("MAT4", joined(translation_matrix(0, 0, 0), translation_matrix(0, -1, 0)));
  file.json["meshes"] = {
      {{"name", "Ribbon"},
       {"primitives",
        {{{"attributes", {{"POSITION", position}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}},
          {"indices", indices}}}}}};
  file.json["nodes"] = {{{"name", "Body"}, {"mesh", 0}, {"skin", 0}},
                        {{"name", "Root"}, {"children", {2}}},
                        {{"name", "Tip"}, {"translation", {0, 1, 0}}}};
  file.json["skins"] = {{{"joints", {1, 2}}, {"inverseBindMatrices", bind}}};
  file.json["scenes"] = {{{"nodes", {0, 1}}}};
  file.json["scene"] = 0;
  return file;
}

}  // namespace sinew::small_gltf
