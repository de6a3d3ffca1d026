#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/mesh.h"

namespace sinew {

/// One per-vertex attribute of a primitive that we carry but do not compute: texture coordinates,
/// colours, normals, tangents, whatever a glTF names with a leading underscore. glTF's codes.
struct VertexAttribute {
  std::string name;            ///< glTF semantic: NORMAL, TEXCOORD_0, COLOR_0, TANGENT, _ANY
  int component_type = 5126;   ///< 5120 i8, 5121 u8, 5122 i16, 5123 u16, 5125 u32, 5126 f32
  int components = 3;          ///< 1 to 4
  bool normalized = false;
  std::vector<std::byte> data;  ///< vertex_count * components, tightly packed, little endian
};

/// Part of the source with one material. Its vertices are rows first_vertex up to
/// first_vertex + vertex_count of MeshAsset::source_positions, in the file's order.
struct SourcePrimitive {
  std::string name;                       ///< of the mesh or group it came from
  int first_vertex = 0;
  int vertex_count = 0;
  std::vector<std::uint32_t> indices;     ///< triangles, relative to first_vertex, in the file's order
  int material = -1;                      ///< index into the materials of MeshAsset::appearance_json
  std::vector<VertexAttribute> attributes;
};

struct SourceImage {
  std::string name;
  std::string mime_type;  ///< image/png or image/jpeg
  std::vector<std::byte> bytes;
};

/// What was found while reading: never repaired in silence.
struct MeshDiagnosis {
  std::int64_t source_vertices = 0;
  std::int64_t source_faces = 0;        ///< polygons as the file has them; a reader's to fill
  std::int64_t triangles = 0;           ///< after triangulation
  std::int64_t welded_vertices = 0;
  std::int64_t unreferenced_vertices = 0;
  std::int64_t degenerate_triangles = 0;   ///< two corners at one welded vertex, or no area
  std::int64_t duplicate_triangles = 0;
  int components = 0;                   ///< of the welded surface
  std::int64_t boundary_edges = 0;
  std::int64_t non_manifold_edges = 0;  ///< more than two triangles
  std::int64_t inconsistent_edges = 0;  ///< run by several triangles in the same direction; twice when in both
  bool closed = false;                  ///< no boundary and no non-manifold edge
  bool outward = true;                  ///< as read, the enclosed volume is positive; true when not closed
};

/// A mesh file: the welded surface that is solved, and all that the file carried besides.
struct MeshAsset {
  std::filesystem::path path;
  std::string format;                    ///< "obj", "ply", "off", "stl", "gltf", "glb"
  TriMesh mesh;                          ///< welded; degenerate triangles left out
  Field3 source_positions;               ///< every vertex of the source, mesh space (glTF: scene space at bind)
  std::vector<int> vertex_of_source;     ///< source row -> vertex of `mesh`; -1 for an unreferenced one
  /// Where a file numbers its positions apart from their texture coordinates and normals (OBJ): row -> the
  /// position it was made from, in the file's order; each position has a row or more. So a cache in that order
  /// fits the file as other programs load it. Empty when rows and the file's vertices are the same.
  std::vector<int> file_vertex_of_row;
  std::vector<SourcePrimitive> primitives;
  /// glTF arrays that travel untouched: an object with "materials", "textures", "samplers",
  /// "images" (bufferView and uri replaced by "source": index into `images`), and the
  /// extensions they use in "extensionsUsed". Empty when there are none.
  std::string appearance_json;
  std::vector<SourceImage> images;
  MeshDiagnosis diagnosis;
  std::vector<std::string> warnings;
};

/// Welds vertices closer than `tolerance` times the bounding-box diagonal (a grid hash with
/// neighbours looked up, each cluster taking its first vertex's position), drops degenerate
/// triangles, and fills mesh, vertex_of_source and diagnosis from source_positions and primitives; of the
/// diagnosis source_faces is kept. Vertices keep the order of their first rows, triangles that of the
/// primitives. A vertex that only degenerate triangles use stays, without a triangle. Triangles without
/// area but with three corners still count when edges and components are counted. A closed surface that
/// faces inward is turned in `mesh`, not in the primitives, with one warning.
/// Linear. Throws FileError (unusable) when no triangle is left.
void weld_and_diagnose(MeshAsset& asset, double tolerance = 1e-6);

/// Reads OBJ, PLY, OFF or STL by extension; glTF and GLB through read_gltf_mesh().
/// Throws FileError.
MeshAsset read_mesh(const std::filesystem::path& path);

}  // namespace sinew
