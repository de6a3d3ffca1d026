#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

/// A viewer in miniature, written from the glTF specification alone: plays a GLB at a moment and
/// says where its vertices are. Only what the writer may use is understood.
class GlbDecoder {
 public:
  struct Shape {
    std::vector<Eigen::Vector3d> positions;  ///< of all visible primitives, in order
    std::vector<Eigen::Vector3d> normals;    ///< unit; empty when the file has none
  };

  explicit GlbDecoder(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    bytes_.assign(std::istreambuf_iterator<char>(file), {});
    const auto json_length = word(12);
    json = nlohmann::json::parse(bytes_.begin() + 20, bytes_.begin() + 20 + json_length);
    binary_ = 20 + json_length + 8;
  }

  const std::vector<char>& bytes() const { return bytes_; }
  std::uint32_t word(std::size_t at) const {
    std::uint32_t value = 0;
    std::memcpy(&value, &bytes_.at(at), 4);
    return value;
  }

  /// The bytes of element `i` of an accessor.
  std::string element(int accessor, int i) const {
    const auto& a = json["accessors"][accessor];
    const auto& view = json["bufferViews"][a["bufferView"].get<int>()];
    const int size = components(a) * component_size(a);
    const std::size_t at =
        binary_ + view["byteOffset"].get<std::size_t>() + a["byteOffset"].get<std::size_t>() +
        static_cast<std::size_t>(i) * view.value("byteStride", static_cast<std::size_t>(size));
    return {bytes_.data() + at, static_cast<std::size_t>(size)};
  }

  std::string view_bytes(int view) const {
    const auto& v = json["bufferViews"][view];
    return {bytes_.data() + binary_ + v["byteOffset"].get<std::size_t>(), v["byteLength"].get<std::size_t>()};
  }

  /// All numbers of an accessor: floats, or bytes and shorts (normalized ones divided).
  std::vector<double> values(int accessor) const {
    const auto& a = json["accessors"][accessor];
    std::vector<double> result;
    for (int i = 0; i < a["count"].get<int>(); ++i) {
      const std::string bytes = element(accessor, i);
      for (int c = 0; c < components(a); ++c) result.push_back(number(a, bytes, c));
    }
    return result;
  }

  /// Value of a sampler at a moment; `width` numbers a key. Rotations are normalized, not slerped:
  /// the tests look at key times only.
  std::vector<double> sample(const nlohmann::json& sampler, double time, int width) const {
    const std::vector<double> times = values(sampler["input"]);
    const std::vector<double> outputs = values(sampler["output"]);
    const auto key = [&](std::size_t i) {
      const auto first = outputs.begin() + static_cast<std::ptrdiff_t>(i) * width;
      return std::vector<double>(first, first + width);
    };
    const auto after =
        static_cast<std::size_t>(std::upper_bound(times.begin(), times.end(), time) - times.begin());
    if (after == 0) return key(0);
    if (after == times.size() || sampler["interpolation"] == "STEP") return key(after - 1);
    const double share = (time - times[after - 1]) / (times[after] - times[after - 1]);
    std::vector<double> low = key(after - 1);
    const std::vector<double> high = key(after);
    for (std::size_t i = 0; i < low.size(); ++i) low[i] += share * (high[i] - low[i]);
    return low;
  }

  Shape shape_at(double time) const {
    Shape shape;
    for (const int root : json["scenes"][0]["nodes"]) visit(root, Eigen::Affine3d::Identity(), time, shape);
    return shape;
  }

  nlohmann::json json;

 private:
  static int components(const nlohmann::json& accessor) {
    const std::string type = accessor["type"];
    return type == "SCALAR" ? 1 : type.back() - '0';
  }
  static int component_size(const nlohmann::json& accessor) {
    const int type = accessor["componentType"];
    return type <= 5121 ? 1 : type <= 5123 ? 2 : 4;
  }
  static double number(const nlohmann::json& accessor, const std::string& bytes, int c) {
    const int type = accessor["componentType"];
    const char* at = bytes.data() + c * component_size(accessor);
    float real = 0.0F;
    std::uint8_t byte = 0;
    std::uint16_t half = 0;
    std::uint32_t whole = 0;
    if (type == 5126) return std::memcpy(&real, at, 4), static_cast<double>(real);
    if (type == 5121)
      return std::memcpy(&byte, at, 1), accessor.value("normalized", false) ? byte / 255.0 : byte;
    if (type == 5123) return std::memcpy(&half, at, 2), half;
    return std::memcpy(&whole, at, 4), whole;
  }

  std::vector<double> property(int node, const char* path, double time, std::vector<double> rest) const {
    for (const auto& animation : json.value("animations", nlohmann::json::array()))
      for (const auto& channel : animation["channels"])
        if (channel["target"]["node"] == node && channel["target"]["path"] == path)
          return sample(animation["samplers"][channel["sampler"].get<int>()], time,
                        static_cast<int>(rest.size()));
    return rest;
  }

  void visit(int node, const Eigen::Affine3d& parent, double time, Shape& shape) const {
    const auto& n = json["nodes"][node];
    const auto t = property(node, "translation", time, n.value("translation", std::vector<double>{0, 0, 0}));
    const auto r = property(node, "rotation", time, n.value("rotation", std::vector<double>{0, 0, 0, 1}));
    const auto s = property(node, "scale", time, n.value("scale", std::vector<double>{1, 1, 1}));
    const Eigen::Matrix3d rotation =
        Eigen::Quaterniond(r[3], r[0], r[1], r[2]).normalized().toRotationMatrix();
    Eigen::Affine3d local;
    local.translation() << t[0], t[1], t[2];
    local.linear() = rotation * Eigen::Vector3d(s[0], s[1], s[2]).asDiagonal();
    const Eigen::Affine3d world = parent * local;
    if (world.linear().determinant() == 0.0) return;
    if (n.contains("mesh")) add_mesh(node, n["mesh"], world, time, shape);
    for (const int child : n.value("children", std::vector<int>{})) visit(child, world, time, shape);
  }

  void add_mesh(int node, int mesh, const Eigen::Affine3d& world, double time, Shape& shape) const {
    for (const auto& primitive : json["meshes"][mesh]["primitives"]) {
      const auto targets = primitive.value("targets", nlohmann::json::array());
      const std::vector<double> weights =
          property(node, "weights", time, std::vector<double>(targets.size(), 0.0));
      const auto blend = [&](const char* name) {
        std::vector<double> sum = values(primitive["attributes"][name]);
        for (std::size_t k = 0; k < targets.size(); ++k) {
          if (weights[k] == 0.0) continue;
          const std::vector<double> target = values(targets[k][name]);
          for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += weights[k] * target[i];
        }
        return sum;
      };
      const std::vector<double> positions = blend("POSITION");
      for (std::size_t i = 0; i < positions.size(); i += 3)
        shape.positions.push_back(world * Eigen::Vector3d(positions[i], positions[i + 1], positions[i + 2]));
      if (!primitive["attributes"].contains("NORMAL")) continue;
      const std::vector<double> normals = blend("NORMAL");
      for (std::size_t i = 0; i < normals.size(); i += 3)
        shape.normals.push_back(
            (world.linear() * Eigen::Vector3d(normals[i], normals[i + 1], normals[i + 2])).normalized());
    }
  }

  std::vector<char> bytes_;
  std::size_t binary_ = 0;
};
