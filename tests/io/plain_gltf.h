#pragma once

// A second reading of glTF for tests: straight from the file's bytes, with no checks, no shared code and
// nothing but what the test files use (linear keys, one set of four float or integer weights). It
// follows the specification's formulas recursively, one vertex at a time.

#include <Eigen/Dense>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace sinew::plain_gltf {

using Json = nlohmann::json;
using Row = std::vector<double>;

struct File {
  Json json;
  std::vector<std::string> buffers;
};

inline std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

inline std::string from_base64(const std::string& text) {
  const std::string letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  std::string bits;
  for (const char letter : text.substr(0, text.find('='))) {
    for (int bit = 5; bit >= 0; --bit) bits += (letters.find(letter) >> bit & 1) ? '1' : '0';
  }
  for (std::size_t i = 0; i + 8 <= bits.size(); i += 8)
    bytes += static_cast<char>(std::stoi(bits.substr(i, 8), nullptr, 2));
  return bytes;
}

inline File load(const std::filesystem::path& path) {
  const std::string all = bytes_of(path);
  if (all.substr(0, 4) == "glTF") {
    std::uint32_t length = 0;
    std::memcpy(&length, all.data() + 12, 4);
    return {Json::parse(all.substr(20, length)), {all.substr(20 + length + 8)}};
  }
  File file{Json::parse(all), {}};
  for (const Json& buffer : file.json["buffers"]) {
    const std::string uri = buffer["uri"];
    const bool inside = uri.substr(0, 5) == "data:";
    file.buffers.push_back(inside ? from_base64(uri.substr(uri.find(',') + 1))
                                  : bytes_of(path.parent_path() / uri));
  }
  return file;
}

template <class Number>
double number(const char* from, double full_scale) {
  Number value;
  std::memcpy(&value, from, sizeof value);
  return static_cast<double>(value) / full_scale;
}

/// Element `index` of an accessor.
inline Row element(const File& file, int accessor, int index) {
  const Json& a = file.json["accessors"][accessor];
  const Json& view = file.json["bufferViews"][int(a["bufferView"])];
  const int type = a["componentType"];
  const int size = type <= 5121 ? 1 : type <= 5123 ? 2 : 4;
  const std::string kind = a["type"];
  const int count = kind == "SCALAR" ? 1 : kind == "MAT4" ? 16 : kind[3] - '0';
  const int stride = view.value("byteStride", size * count);
  const char* from = file.buffers[int(view["buffer"])].data() + view.value("byteOffset", 0) +
                     a.value("byteOffset", 0) + std::ptrdiff_t(index) * stride;
  const bool share = a.value("normalized", false);
  Row row;
  for (int i = 0; i < count; ++i, from += size) {
    if (type == 5121) row.push_back(number<unsigned char>(from, share ? 255 : 1));
    if (type == 5123) row.push_back(number<unsigned short>(from, share ? 65535 : 1));
    if (type == 5125) row.push_back(number<unsigned>(from, 1));
    if (type == 5126) row.push_back(number<float>(from, 1));
  }
  return row;
}

/// A channel's value at time t, or `otherwise` where there is no such channel.
inline Row sample(const File& file, int animation, int node, const std::string& path, double t,
                  const Row& otherwise) {
  const Json& a = file.json["animations"][animation];
  for (const Json& channel : a["channels"]) {
    if (channel["target"].value("node", -1) != node || channel["target"]["path"] != path) continue;
    const Json& sampler = a["samplers"][int(channel["sampler"])];
    const int input = sampler["input"], output = sampler["output"];
    const int keys = file.json["accessors"][input]["count"];
    int k = 0;
    while (k < keys && element(file, input, k)[0] <= t) ++k;
    if (k == 0 || k == keys) return element(file, output, k == 0 ? 0 : keys - 1);
    const double t0 = element(file, input, k - 1)[0], t1 = element(file, input, k)[0],
                 s = (t - t0) / (t1 - t0);
    Row p = element(file, output, k - 1), q = element(file, output, k);
    double u = 1 - s, v = s;
    if (path == "rotation") {
      double dot = 0;
      for (int i = 0; i < 4; ++i) dot += p[i] * q[i];
      const double angle = std::acos(std::min(1.0, std::abs(dot)));
      if (angle > 1e-6)
        u = std::sin((1 - s) * angle) / std::sin(angle), v = std::sin(s * angle) / std::sin(angle);
      if (dot < 0) v = -v;
    }
    for (std::size_t i = 0; i < p.size(); ++i) p[i] = u * p[i] + v * q[i];
    return p;
  }
  return otherwise;
}

inline Eigen::Matrix4d local(const File& file, int animation, int node, double t) {
  const Json& n = file.json["nodes"][node];
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  if (n.contains("matrix")) {
    for (int i = 0; i < 16; ++i) m(i % 4, i / 4) = n["matrix"][i];
    return m;
  }
  const Row p = sample(file, animation, node, "translation", t, n.value("translation", Row{0, 0, 0}));
  const Row s = sample(file, animation, node, "scale", t, n.value("scale", Row{1, 1, 1}));
  const Row r = sample(file, animation, node, "rotation", t, n.value("rotation", Row{0, 0, 0, 1}));
  const double f = 2 / (r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3]);
  const double x = r[0], y = r[1], z = r[2], w = r[3];
  m.topLeftCorner<3, 3>() << 1 - f * (y * y + z * z), f * (x * y - z * w), f * (x * z + y * w),  //
      f * (x * y + z * w), 1 - f * (x * x + z * z), f * (y * z - x * w),                         //
      f * (x * z - y * w), f * (y * z + x * w), 1 - f * (x * x + y * y);
  for (int i = 0; i < 3; ++i) m.col(i).head<3>() *= s[i], m(i, 3) = p[i];
  return m;
}

/// Appends all vertices below a node, depth first, as a viewer places them.
inline void draw(const File& file, int animation, int node, double t,
                 const std::vector<Eigen::Matrix4d>& world, std::vector<Eigen::Vector3d>& out) {
  const Json& n = file.json["nodes"][node];
  const Json mesh = n.contains("mesh") ? file.json["meshes"][int(n["mesh"])]["primitives"] : Json::array();
  for (const Json& primitive : mesh) {
    const Json& attributes = primitive["attributes"];
    const int position = attributes["POSITION"];
    for (int v = 0; v < file.json["accessors"][position]["count"]; ++v) {
      const Row p = element(file, position, v);
      Eigen::Matrix4d m = world[node];
      if (n.contains("skin")) {
        const Json& skin = file.json["skins"][int(n["skin"])];
        const Row joints = element(file, attributes["JOINTS_0"], v),
                  weights = element(file, attributes["WEIGHTS_0"], v);
        const double sum = weights[0] + weights[1] + weights[2] + weights[3];
        m.setZero();
        for (int i = 0; i < 4; ++i) {
          const Row bind = element(file, skin["inverseBindMatrices"], int(joints[i]));
          m += weights[i] / sum * world[int(skin["joints"][int(joints[i])])] *
               Eigen::Map<const Eigen::Matrix4d>(bind.data());
        }
      }
      out.push_back((m * Eigen::Vector4d(p[0], p[1], p[2], 1)).head<3>());
    }
  }
  for (const Json& child : n.value("children", Json::array())) draw(file, animation, child, t, world, out);
}

inline void place(const File& file, int animation, int node, double t, const Eigen::Matrix4d& parent,
                  std::vector<Eigen::Matrix4d>& world) {
  world[node] = parent * local(file, animation, node, t);
  for (const Json& child : file.json["nodes"][node].value("children", Json::array())) {
    place(file, animation, child, t, world[node], world);
  }
}

/// All vertices of the default scene at time t.
inline std::vector<Eigen::Vector3d> vertices(const File& file, int animation, double t) {
  std::vector<Eigen::Matrix4d> world(file.json["nodes"].size(), Eigen::Matrix4d::Identity());
  std::vector<Eigen::Vector3d> out;
  const Json& roots = file.json["scenes"][file.json.value("scene", 0)]["nodes"];
  for (const Json& root : roots) place(file, animation, root, t, Eigen::Matrix4d::Identity(), world);
  for (const Json& root : roots) draw(file, animation, root, t, world, out);
  return out;
}

}  // namespace sinew::plain_gltf
