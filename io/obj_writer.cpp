#include "io/obj_writer.h"

#include <algorithm>
#include <charconv>
#include <cstring>
#include <numeric>
#include <stdexcept>

#include "io/atomic_file.h"
#include "io/surface_normals.h"
#include "io/text_scanner.h"

namespace sinew {
namespace {

constexpr int kNone = -1;

class ObjText {
 public:
  explicit ObjText(AtomicFile& file) : file_(file) {}

  void word(std::string_view text) { buffer_ += text; }
  void number(double value) {
    char digits[32];
    const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
    buffer_.append(digits, end);
  }
  /// Seven digits: a texture coordinate has been through a subtraction in floats.
  void rounded(double value) {
    char digits[32];
    const auto end = std::to_chars(digits, digits + sizeof digits, value, std::chars_format::general, 7).ptr;
    buffer_.append(digits, end);
  }
  void index(int value) { buffer_ += std::to_string(value); }
  void end_line() {
    buffer_ += '\n';
    if (buffer_.size() > kChunk) flush();
  }
  void flush() {
    file_.write(buffer_);
    buffer_.clear();
  }

 private:
  static constexpr std::size_t kChunk = 1 << 20;
  AtomicFile& file_;
  std::string buffer_;
};

const VertexAttribute* find_attribute(const SourcePrimitive& primitive, std::string_view name) {
  const auto found = std::find_if(primitive.attributes.begin(), primitive.attributes.end(),
                                  [name](const VertexAttribute& attribute) { return attribute.name == name; });
  return found == primitive.attributes.end() ? nullptr : &*found;
}

/// Texture coordinates are floats, or shares of the whole range of an unsigned type.
double component(const VertexAttribute& attribute, int vertex, int which) {
  const std::size_t at = static_cast<std::size_t>(vertex) * attribute.components + which;
  const std::byte* data = attribute.data.data();
  if (attribute.component_type == 5121) return static_cast<double>(data[at]) / 255.0;
  if (attribute.component_type == 5123) {
    std::uint16_t value = 0;
    std::memcpy(&value, data + 2 * at, sizeof value);
    return value / 65535.0;
  }
  float value = 0;
  std::memcpy(&value, data + 4 * at, sizeof value);
  return value;
}

/// Which v each row of the source is; without a numbering of the file's own, each row is one.
std::vector<int> numbers_of_rows(const MeshAsset& asset) {
  std::vector<int> numbers = asset.file_vertex_of_row;
  if (numbers.empty()) {
    numbers.resize(asset.source_positions.rows());
    std::iota(numbers.begin(), numbers.end(), 0);
  }
  return numbers;
}

void write_positions(ObjText& out, const MeshAsset& asset, const std::vector<int>& vertex_of_row,
                     const Eigen::Ref<const Field3>& positions) {
  std::vector<int> row_of_vertex;
  for (std::size_t row = 0; row < vertex_of_row.size(); ++row) {
    const auto vertex = static_cast<std::size_t>(vertex_of_row[row]);
    if (vertex >= row_of_vertex.size()) row_of_vertex.resize(vertex + 1, kNone);
    // Of several rows take one that moves.
    if (row_of_vertex[vertex] == kNone || asset.vertex_of_source[row_of_vertex[vertex]] < 0) {
      row_of_vertex[vertex] = static_cast<int>(row);
    }
  }
  for (const int row : row_of_vertex) {
    const int welded = asset.vertex_of_source[row];
    out.word("v");
    for (int axis = 0; axis < 3; ++axis) {
      out.word(" ");
      out.number(welded < 0 ? asset.source_positions(row, axis) : positions(welded, axis));
    }
    out.end_line();
  }
}

/// Row -> number of its vt, from 1; kNone where its primitive has none.
std::vector<int> write_texture_coordinates(ObjText& out, const MeshAsset& asset) {
  std::vector<int> number_of_row(asset.source_positions.rows(), kNone);
  int count = 0;
  for (const SourcePrimitive& primitive : asset.primitives) {
    const VertexAttribute* attribute = find_attribute(primitive, "TEXCOORD_0");
    if (!attribute || attribute->components != 2) continue;
    for (int vertex = 0; vertex < primitive.vertex_count; ++vertex) {
      number_of_row[primitive.first_vertex + vertex] = ++count;
      out.word("vt ");
      out.rounded(component(*attribute, vertex, 0));
      out.word(" ");
      out.rounded(1.0 - component(*attribute, vertex, 1));  // glTF counts down from the upper edge
      out.end_line();
    }
  }
  return number_of_row;
}

/// Row -> number of its vn, from 1; kNone where its primitive had no normals.
std::vector<int> write_normals(ObjText& out, const MeshAsset& asset, const Eigen::Ref<const Field3>& positions) {
  std::vector<int> number_of_row(asset.source_positions.rows(), kNone);
  const auto has_normals = [](const SourcePrimitive& primitive) { return find_attribute(primitive, "NORMAL"); };
  if (std::none_of(asset.primitives.begin(), asset.primitives.end(), has_normals)) return number_of_row;
  const SurfaceNormals surface(asset);
  std::vector<double> flat(3 * static_cast<std::size_t>(asset.mesh.vertex_count()));
  Eigen::Map<Field3>(flat.data(), asset.mesh.vertex_count(), 3) = positions.topRows(asset.mesh.vertex_count());
  std::vector<double> normals(3 * static_cast<std::size_t>(surface.group_count()));
  surface.deformed(flat, normals);
  for (int group = 0; group < surface.group_count(); ++group) {
    out.word("vn");
    for (int axis = 0; axis < 3; ++axis) {
      out.word(" ");
      out.rounded(normals[3 * static_cast<std::size_t>(group) + axis]);
    }
    out.end_line();
  }
  for (const SourcePrimitive& primitive : asset.primitives) {
    if (!has_normals(primitive)) continue;
    for (int row = primitive.first_vertex; row < primitive.first_vertex + primitive.vertex_count; ++row) {
      const int group = surface.group_of_row()[row];
      number_of_row[row] = group < 0 ? kNone : group + 1;
    }
  }
  return number_of_row;
}

/// "7", "7/3", "7//2" or "7/3/2".
void write_corner(ObjText& out, int vertex, int texture, int normal) {
  out.word(" ");
  out.index(vertex);
  if (texture != kNone || normal != kNone) out.word("/");
  if (texture != kNone) out.index(texture);
  if (normal == kNone) return;
  out.word("/");
  out.index(normal);
}

}  // namespace

void write_obj(const std::filesystem::path& path, const MeshAsset& asset,
               const Eigen::Ref<const Field3>& positions) {
  if (positions.rows() < asset.mesh.vertex_count()) {
    throw std::invalid_argument("write_obj: " + std::to_string(positions.rows()) + " positions; the mesh has " +
                                std::to_string(asset.mesh.vertex_count()) + " vertices");
  }
  AtomicFile file(path);
  ObjText out(file);
  const std::vector<int> vertex_of_row = numbers_of_rows(asset);
  write_positions(out, asset, vertex_of_row, positions);
  const std::vector<int> texture_of_row = write_texture_coordinates(out, asset);
  const std::vector<int> normal_of_row = write_normals(out, asset, positions);
  for (const SourcePrimitive& primitive : asset.primitives) {
    if (!primitive.name.empty() || asset.primitives.size() > 1) {
      out.word("g " + printable_name(primitive.name));
      out.end_line();
    }
    for (std::size_t i = 0; i + 2 < primitive.indices.size(); i += 3) {
      out.word("f");
      for (std::size_t corner = i; corner < i + 3; ++corner) {
        const int row = primitive.first_vertex + static_cast<int>(primitive.indices[corner]);
        write_corner(out, vertex_of_row[row] + 1, texture_of_row[row], normal_of_row[row]);
      }
      out.end_line();
    }
  }
  out.flush();
  file.commit();
}

}  // namespace sinew
