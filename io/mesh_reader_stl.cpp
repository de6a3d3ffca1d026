// STL, text and binary, as 3D Systems' SLC file specification of 1989 has it and as programs write it.
#include <bit>
#include <cmath>
#include <cstring>
#include <string>

#include "io/file_error.h"
#include "io/mesh_reader.h"
#include "io/text_scanner.h"

namespace sinew {
namespace {

static_assert(std::endian::native == std::endian::little, "binary meshes are read as little endian");

constexpr std::size_t kHeader = 84;    // 80 bytes of anything, then the number of triangles
constexpr std::size_t kTriangle = 50;  // normal, three corners, two bytes of attributes

/// Some programs begin binary files with "solid" too, so the sizes are asked first.
bool is_binary(std::string_view bytes) {
  if (bytes.size() >= kHeader) {
    std::uint32_t count = 0;
    std::memcpy(&count, bytes.data() + 80, 4);
    if (bytes.size() == kHeader + kTriangle * count) return true;
  }
  LineReader lines(bytes.substr(0, 512));  // which steps over a byte order mark
  lines.next();
  const std::string_view start = trimmed(lines.line());
  return !equal_ignoring_case(start.substr(0, 5), "solid") || bytes.substr(0, 512).find('\0') != bytes.npos;
}

void set_positions(MeshAsset& asset, const std::vector<Eigen::Vector3d>& positions) {
  const auto rows = static_cast<Eigen::Index>(positions.size());
  asset.source_positions.resize(rows, 3);
  if (rows > 0) std::memcpy(asset.source_positions.data(), positions.data(), positions.size() * sizeof(Eigen::Vector3d));
}

MeshAsset parse_binary(std::string_view bytes, const std::filesystem::path& name) {
  const auto at = [&](std::size_t byte) { return name.string() + "@" + std::to_string(byte); };
  if (bytes.size() < kHeader) {
    throw FileError(FileFault::malformed, at(bytes.size()),
                    "file ends inside the header; expected 'solid', or 84 bytes of binary STL");
  }
  std::uint32_t count = 0;
  std::memcpy(&count, bytes.data() + 80, 4);
  check_count(count, kTriangle, bytes.size() - kHeader, at(80), "triangles");
  MeshAsset asset;
  const std::size_t trailing = bytes.size() - kHeader - kTriangle * count;
  if (trailing > 0) {
    asset.warnings.push_back("W_STL_TRAILING: " + counted(trailing, "byte", "bytes") +
                             " after the last triangle not read");
  }
  asset.source_positions.resize(3 * Eigen::Index{count}, 3);
  SourcePrimitive primitive;
  primitive.vertex_count = static_cast<int>(3 * count);
  for (std::uint32_t row = 0; row < 3 * count; ++row) {
    const std::size_t byte = kHeader + kTriangle * (row / 3) + 12 + 12 * (row % 3);
    float corner[3];
    std::memcpy(corner, bytes.data() + byte, sizeof corner);
    for (int axis = 0; axis < 3; ++axis) {
      if (!std::isfinite(corner[axis])) {
        throw FileError(FileFault::malformed, at(byte + 4 * axis), "coordinate is not a finite number");
      }
      asset.source_positions(row, axis) = corner[axis];
    }
    primitive.indices.push_back(row);
  }
  asset.primitives.push_back(std::move(primitive));
  asset.diagnosis.source_faces = count;
  return asset;
}

class StlTextParser {
 public:
  StlTextParser(std::string_view text, const std::filesystem::path& name) : lines_(text), name_(name) {}

  MeshAsset parse() {
    while (lines_.next()) {
      std::string_view rest = lines_.line();
      const std::string_view word = take_word(rest);
      if (!word.empty()) read_statement(word, rest);
    }
    if (in_facet_) here().fail("file ends inside a facet; expected 'endfacet'");
    if (in_solid_) asset_.warnings.push_back("W_STL_END: no 'endsolid'; the file may have been cut short");
    set_positions(asset_, positions_);
    cutter_.report(asset_);
    return std::move(asset_);
  }

 private:
  TextPlace here() const { return {name_, lines_.number()}; }

  void read_statement(std::string_view word, std::string_view rest) {
    const auto is = [&](std::string_view keyword) { return equal_ignoring_case(word, keyword); };
    if (is("solid")) return begin_solid(rest);
    if (!in_solid_) here().fail("found " + in_quotes(word) + "; expected 'solid'");
    if (is("vertex") && in_facet_) return read_vertex(rest);
    if (is("facet") && !in_facet_) return begin_facet();
    if (is("endfacet") && in_facet_) return end_facet();
    if (is("outer") || is("endloop")) {
      if (in_facet_) return;
    }
    if (is("endsolid") && !in_facet_) {
      in_solid_ = false;
      return;
    }
    here().fail("found " + in_quotes(word) + (in_facet_ ? "; expected 'vertex' or 'endfacet'" : "; expected 'facet' or 'endsolid'"));
  }

  void begin_solid(std::string_view solid_name) {
    if (in_facet_) here().fail("found 'solid'; expected 'vertex' or 'endfacet'");
    in_solid_ = true;
    if (asset_.primitives.empty() || asset_.primitives.back().vertex_count > 0) asset_.primitives.emplace_back();
    asset_.primitives.back().name = printable_name(solid_name);
    asset_.primitives.back().first_vertex = static_cast<int>(positions_.size());
  }

  void begin_facet() {
    in_facet_ = true;
    corners_.clear();
  }

  void read_vertex(std::string_view rest) {
    Eigen::Vector3d position;
    const int found = count_words(rest);
    if (found != 3) here().fail("vertex has " + counted(found, "value", "values") + "; expected 3");
    for (double& value : position) value = to_number(take_word(rest), here());
    corners_.push_back(position);
  }

  void end_facet() {
    in_facet_ = false;
    const Field3 positions = Eigen::Map<const Field3>(corners_.empty() ? nullptr : corners_[0].data(),
                                                      static_cast<Eigen::Index>(corners_.size()), 3);
    SourcePrimitive& primitive = asset_.primitives.back();
    rows_.clear();
    written_.clear();
    for (const Eigen::Vector3d& corner : corners_) {
      rows_.push_back(static_cast<int>(rows_.size()));
      written_.push_back(static_cast<std::uint32_t>(primitive.vertex_count++));
      positions_.push_back(corner);
    }
    cutter_.cut(rows_, positions, written_, primitive.indices);
  }

  LineReader lines_;
  const std::filesystem::path& name_;
  bool in_solid_ = false;
  bool in_facet_ = false;
  std::vector<Eigen::Vector3d> corners_;  // of the facet being read
  std::vector<Eigen::Vector3d> positions_;
  std::vector<int> rows_;
  std::vector<std::uint32_t> written_;
  PolygonCutter cutter_;
  MeshAsset asset_;
};

}  // namespace

MeshAsset parse_stl(std::string_view bytes, const std::filesystem::path& name) {
  return is_binary(bytes) ? parse_binary(bytes, name) : StlTextParser(bytes, name).parse();
}

}  // namespace sinew
