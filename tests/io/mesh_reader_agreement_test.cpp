// OpenMesh as an independent reader of the same files. It builds half-edges, so only manifold meshes are compared.
#include <OpenMesh/Core/IO/MeshIO.hh>
#include <OpenMesh/Core/Mesh/PolyMesh_ArrayKernelT.hh>

#include <gtest/gtest.h>

#include <algorithm>

#include "io/mesh_asset.h"

namespace sinew {
namespace {

using PolyMesh = OpenMesh::PolyMesh_ArrayKernelT<>;

/// Faces as OpenMesh has them, which keeps the file's order.
std::vector<std::vector<int>> polygons_of(const PolyMesh& mesh) {
  std::vector<std::vector<int>> polygons;
  for (const auto face : mesh.faces()) {
    std::vector<int> polygon;
    for (const auto vertex : mesh.fv_range(face)) polygon.push_back(vertex.idx());
    polygons.push_back(polygon);
  }
  return polygons;
}

bool holds_corners(const std::vector<int>& polygon, const std::array<int, 3>& triangle) {
  return std::all_of(triangle.begin(), triangle.end(), [&](int vertex) {
    return std::find(polygon.begin(), polygon.end(), vertex) != polygon.end();
  });
}

TEST(ReadMesh, agrees_with_OpenMesh_on_manifold_meshes) {
  const std::filesystem::path data = SINEW_SHARED_DATA;
  if (!std::filesystem::is_directory(data)) GTEST_SKIP() << "no shared data at " << data;
  for (const char* file : {"meshes/odedstein/cat-low-resolution.obj", "meshes/odedstein/human_man.obj",
                           "meshes/sofa/raptor_8kp.obj", "large/jaxa-itokawa/itokawa_200k.ply", "bad/cgal/blobby_3cc.off"}) {
    SCOPED_TRACE(file);
    const MeshAsset ours = read_mesh(data / file);
    PolyMesh theirs;
    ASSERT_TRUE(OpenMesh::IO::read_mesh(theirs, (data / file).string()));
    // Ours in the file's numbering.
    std::vector<int> file_vertex_of_row = ours.file_vertex_of_row;
    if (file_vertex_of_row.empty()) {
      for (Eigen::Index row = 0; row < ours.source_positions.rows(); ++row) file_vertex_of_row.push_back(static_cast<int>(row));
    }
    std::vector<bool> seen(theirs.n_vertices());
    for (std::size_t row = 0; row < file_vertex_of_row.size(); ++row) {
      const int vertex = file_vertex_of_row[row];
      ASSERT_LT(static_cast<std::size_t>(vertex), theirs.n_vertices());
      seen[static_cast<std::size_t>(vertex)] = true;
      const auto& point = theirs.point(OpenMesh::VertexHandle(vertex));
      for (int axis = 0; axis < 3; ++axis) {
        ASSERT_EQ(static_cast<float>(ours.source_positions(static_cast<Eigen::Index>(row), axis)), point[static_cast<std::size_t>(axis)]);
      }
    }
    EXPECT_EQ(std::count(seen.begin(), seen.end(), false), 0);

    const std::vector<std::vector<int>> polygons = polygons_of(theirs);
    ASSERT_EQ(static_cast<std::int64_t>(polygons.size()), ours.diagnosis.source_faces);
    ASSERT_EQ(ours.primitives.size(), 1U);
    const auto& indices = ours.primitives[0].indices;
    std::size_t next = 0;
    for (const std::vector<int>& polygon : polygons) {
      for (std::size_t triangle = 0; triangle + 2 < polygon.size(); ++triangle, next += 3) {
        ASSERT_LE(next + 3, indices.size());
        EXPECT_TRUE(holds_corners(polygon, {file_vertex_of_row[indices[next]], file_vertex_of_row[indices[next + 1]],
                                            file_vertex_of_row[indices[next + 2]]}));
      }
    }
    EXPECT_EQ(next, indices.size());
  }
}

}  // namespace
}  // namespace sinew
