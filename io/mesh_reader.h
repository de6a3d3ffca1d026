#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "io/mesh_asset.h"

namespace sinew {

/// The contents of an OBJ, PLY, OFF or STL file, told apart by the extension of `name`, as read_mesh()
/// returns them. Throws FileError, which calls the file `name`.
///
/// All four formats are read by code of our own. OpenMesh 9 reads them too, but not for strangers'
/// files: its OBJ reader opens whatever path an mtllib line names and skips vertices it cannot parse,
/// its PLY reader loops for ever on a property type it does not know, its PLY and OFF readers follow
/// vertex and corner counts past the end of the file until memory is gone, and its STL reader leaves
/// out degenerate triangles without a word. It serves the tests as the independent reader that
/// ours must agree with on good files.
MeshAsset parse_mesh(std::string_view bytes, const std::filesystem::path& name);

/// One format each: fill source_positions, primitives, diagnosis.source_faces and warnings; nothing
/// is welded yet. Each checks a count against the bytes that are left before it allocates.
///
/// Wavefront OBJ. Faces are told apart by o or g and by usemtl, and each kind becomes a primitive:
/// first the `v` it uses in the file's order, then a copy for every further pair of texture coordinate
/// and normal that one of them carries. `v` that no face uses belong to the first primitive, so a file
/// of one group keeps its order whole; file_vertex_of_row leads back to it in any case.
MeshAsset parse_obj(std::string_view bytes, const std::filesystem::path& name);
/// Stanford PLY: text, and binary of either byte order.
MeshAsset parse_ply(std::string_view bytes, const std::filesystem::path& name);
/// Geomview OFF with the prefixes ST, C and N; text.
MeshAsset parse_off(std::string_view bytes, const std::filesystem::path& name);
/// STL: text, and binary. Three vertices of their own to each triangle, as the file has it.
MeshAsset parse_stl(std::string_view bytes, const std::filesystem::path& name);

/// Cuts polygons into triangles as they come and remembers what to say about it.
class PolygonCutter {
 public:
  /// Appends the triangles of the polygon to `indices`. `corners` are rows of `positions`, which it
  /// keeps no longer than the call; `written` are the same corners as they are to be numbered in
  /// `indices`. A convex polygon becomes a fan, any other loses one ear at a time [Meisters 1975].
  void cut(std::span<const int> corners, const Field3& positions, std::span<const std::uint32_t> written,
           std::vector<std::uint32_t>& indices);

  /// Number of polygons, and warnings where some had to be left out or cut badly.
  void report(MeshAsset& asset) const;

 private:
  bool is_strictly_convex() const;
  bool is_ear(std::size_t place) const;
  void project(std::span<const int> corners, const Field3& positions);

  std::int64_t faces_ = 0;
  std::int64_t too_few_corners_ = 0;
  std::int64_t fans_ = 0;  ///< not convex, but cut as if they were
  /// Ear clipping takes quadratic time. A file may ask for this many point-in-triangle tests, about a
  /// second, before the rest of its polygons become fans.
  mutable std::int64_t tests_left_ = 200'000'000;
  std::vector<std::array<double, 2>> flat_;  ///< corners in the polygon's plane, counter-clockwise
  std::vector<int> remaining_;               ///< corners not yet cut off
};

/// NORMAL from three numbers a vertex, made unit vectors. A normal of no length becomes +z, with a warning.
VertexAttribute unit_normals(std::vector<float> values, MeshAsset& asset);

/// TEXCOORD_0 from two numbers a vertex that count up from the lower edge of the picture; glTF counts
/// down from the upper one.
VertexAttribute texture_coordinates(std::vector<float> values);

/// COLOR_0 from red, green and blue in the sRGB encoding, 0 to 1 or 0 to 255; the largest value decides.
/// glTF's colours are linear, 0 to 1. Alpha is not carried: nothing here draws with it.
VertexAttribute linear_colours(std::vector<float> values);

/// Throws FileError (malformed) when `count` items of at least `bytes_each` do not fit into `bytes_left`, or are
/// more than an int can count.
void check_count(std::uint64_t count, std::uint64_t bytes_each, std::uint64_t bytes_left, const std::string& where,
                 const std::string& items);

}  // namespace sinew
