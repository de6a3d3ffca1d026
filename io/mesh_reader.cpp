// What the mesh readers share. Ears are cut after [Meisters 1975, Polygons have ears]; the normal of a
// polygon that is not quite flat is Newell's [Sutherland, Sproull and Schumacker 1974].
#include "io/mesh_reader.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstring>

#include "io/file_error.h"
#include "io/text_scanner.h"

namespace sinew {
namespace {

using Point = std::array<double, 2>;

/// Twice the signed area of the triangle, positive when counter-clockwise.
double turn(const Point& a, const Point& b, const Point& c) {
  return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

bool lies_in(const Point& p, const Point& a, const Point& b, const Point& c) {
  return turn(a, b, p) >= 0 && turn(b, c, p) >= 0 && turn(c, a, p) >= 0;
}

double linear_of_srgb(double value) {
  return value <= 0.04045 ? value / 12.92 : std::pow((value + 0.055) / 1.055, 2.4);
}

VertexAttribute float_attribute(const std::string& name, int components, std::span<const float> values) {
  VertexAttribute attribute{.name = name, .components = components, .data = {}};
  const auto bytes = std::as_bytes(values);
  attribute.data.assign(bytes.begin(), bytes.end());
  return attribute;
}

}  // namespace

MeshAsset parse_mesh(std::string_view bytes, const std::filesystem::path& name) {
  struct Format {
    const char* extension;
    const char* expected;
    MeshAsset (*parse)(std::string_view, const std::filesystem::path&);
  };
  constexpr Format kFormats[] = {{"obj", "an OBJ file", parse_obj},
                                 {"ply", "a PLY file", parse_ply},
                                 {"off", "an OFF file", parse_off},
                                 {"stl", "an STL file", parse_stl}};
  const std::string dotted = name.extension().string();
  const std::string_view extension = std::string_view(dotted).substr(dotted.empty() ? 0 : 1);
  for (const Format& format : kFormats) {
    if (!equal_ignoring_case(extension, format.extension)) continue;
    refuse_disguises(bytes, name, format.expected);
    MeshAsset asset = format.parse(bytes, name);
    asset.path = name;
    asset.format = format.extension;
    weld_and_diagnose(asset);
    return asset;
  }
  throw FileError(FileFault::unusable, name.string(),
                  "is not a mesh by its extension; expected .obj, .ply, .off, .stl, .gltf or .glb");
}

void PolygonCutter::project(std::span<const int> corners, const Field3& positions) {
  const Eigen::RowVector3d origin = positions.row(corners[0]);
  Eigen::RowVector3d normal = Eigen::RowVector3d::Zero();
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::RowVector3d a = positions.row(corners[i]) - origin;
    const Eigen::RowVector3d b = positions.row(corners[(i + 1) % corners.size()]) - origin;
    normal += a.cross(b);
  }
  // Leaving out the axis the normal is closest to keeps the shape best; the other two are taken in the
  // order that keeps it counter-clockwise.
  Eigen::Index axis = 0;
  normal.cwiseAbs().maxCoeff(&axis);
  Eigen::Index u = (axis + 1) % 3;
  Eigen::Index v = (axis + 2) % 3;
  if (normal[axis] < 0) std::swap(u, v);
  flat_.clear();
  for (const int corner : corners) flat_.push_back({positions(corner, u) - origin[u], positions(corner, v) - origin[v]});
}

bool PolygonCutter::is_strictly_convex() const {
  const std::size_t count = flat_.size();
  for (std::size_t i = 0; i < count; ++i) {
    if (!(turn(flat_[i], flat_[(i + 1) % count], flat_[(i + 2) % count]) > 0)) return false;
  }
  return true;
}

bool PolygonCutter::is_ear(std::size_t place) const {
  const std::size_t count = remaining_.size();
  const Point& a = flat_[remaining_[(place + count - 1) % count]];
  const Point& b = flat_[remaining_[place]];
  const Point& c = flat_[remaining_[(place + 1) % count]];
  if (!(turn(a, b, c) > 0)) return false;
  tests_left_ -= static_cast<std::int64_t>(count);
  return std::none_of(remaining_.begin(), remaining_.end(), [&](int corner) {
    const Point& p = flat_[corner];
    return p != a && p != b && p != c && lies_in(p, a, b, c);
  });
}

void PolygonCutter::cut(std::span<const int> corners, const Field3& positions,
                        std::span<const std::uint32_t> written, std::vector<std::uint32_t>& indices) {
  ++faces_;
  if (corners.size() < 3) {
    ++too_few_corners_;
    return;
  }
  const auto emit_fan = [&] {
    for (std::size_t i = 1; i + 1 < remaining_.size(); ++i) {
      for (const std::size_t corner : {std::size_t{0}, i, i + 1}) indices.push_back(written[remaining_[corner]]);
    }
  };
  remaining_.resize(corners.size());
  for (std::size_t i = 0; i < corners.size(); ++i) remaining_[i] = static_cast<int>(i);
  if (corners.size() == 3) return emit_fan();
  project(corners, positions);
  if (is_strictly_convex()) return emit_fan();

  std::size_t place = 0;
  std::size_t failures = 0;  // corners in a row that were no ear
  while (remaining_.size() > 3 && failures < remaining_.size() && tests_left_ > 0) {
    place %= remaining_.size();
    if (!is_ear(place)) {
      ++failures;
      ++place;
      continue;
    }
    const std::size_t count = remaining_.size();
    for (const std::size_t corner : {(place + count - 1) % count, place, (place + 1) % count}) {
      indices.push_back(written[remaining_[corner]]);
    }
    remaining_.erase(remaining_.begin() + static_cast<std::ptrdiff_t>(place));
    failures = 0;
  }
  if (remaining_.size() > 3) ++fans_;
  emit_fan();
}

void PolygonCutter::report(MeshAsset& asset) const {
  asset.diagnosis.source_faces = faces_;
  if (too_few_corners_ > 0) {
    asset.warnings.push_back("W_MESH_FACE_TOO_SMALL: " + counted(too_few_corners_, "face", "faces") +
                             " of fewer than 3 corners left out");
  }
  if (fans_ > 0) {
    asset.warnings.push_back("W_MESH_FACE_FAN: " + counted(fans_, "face", "faces") +
                             " that cross themselves or are too large were cut as if they were convex");
  }
}

VertexAttribute unit_normals(std::vector<float> values, MeshAsset& asset) {
  std::int64_t without_length = 0;
  for (std::size_t i = 0; i + 2 < values.size(); i += 3) {
    Eigen::Map<Eigen::Vector3f> normal(&values[i]);
    const Eigen::Vector3d wide = normal.cast<double>();
    const double length = wide.norm();
    if (length == 0) ++without_length;
    normal = length == 0 ? Eigen::Vector3f::UnitZ() : Eigen::Vector3f((wide / length).cast<float>());
  }
  if (without_length > 0) {
    asset.warnings.push_back("W_MESH_NORMAL: " + counted(without_length, "normal", "normals") +
                             " of no length replaced by +z");
  }
  return float_attribute("NORMAL", 3, values);
}

VertexAttribute texture_coordinates(std::vector<float> values) {
  for (std::size_t i = 1; i < values.size(); i += 2) values[i] = 1.0F - values[i];
  return float_attribute("TEXCOORD_0", 2, values);
}

VertexAttribute linear_colours(std::vector<float> values) {
  const float largest = values.empty() ? 0.0F : *std::max_element(values.begin(), values.end());
  const float unit = largest > 1.0F ? 255.0F : 1.0F;
  for (float& value : values) {
    value = static_cast<float>(linear_of_srgb(std::clamp(value / unit, 0.0F, 1.0F)));
  }
  return float_attribute("COLOR_0", 3, values);
}

void check_count(std::uint64_t count, std::uint64_t bytes_each, std::uint64_t bytes_left, const std::string& where,
                 const std::string& items) {
  const std::uint64_t most = bytes_left / bytes_each;
  if (count <= most && count <= 2'147'483'647) return;
  throw FileError(FileFault::malformed, where,
                  "announces " + std::to_string(count) + " " + items + "; the " + std::to_string(bytes_left) +
                      " bytes that follow hold at most " + std::to_string(most));
}

}  // namespace sinew
