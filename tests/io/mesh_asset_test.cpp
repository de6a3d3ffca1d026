#include "io/mesh_asset.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "samples/shapes.h"
#include "tests/io/refusal.h"

namespace sinew {
namespace {

using Triangles = std::vector<std::array<std::uint32_t, 3>>;

MeshAsset asset_of(const Field3& positions, const Triangles& triangles) {
  MeshAsset asset;
  asset.path = "made.obj";
  asset.source_positions = positions;
  SourcePrimitive primitive;
  primitive.vertex_count = static_cast<int>(positions.rows());
  for (const auto& triangle : triangles) primitive.indices.insert(primitive.indices.end(), triangle.begin(), triangle.end());
  asset.primitives.push_back(primitive);
  return asset;
}

MeshAsset welded(const Field3& positions, const Triangles& triangles) {
  MeshAsset asset = asset_of(positions, triangles);
  weld_and_diagnose(asset);
  return asset;
}

Field3 rows(std::initializer_list<Eigen::RowVector3d> values) {
  Field3 field(static_cast<Eigen::Index>(values.size()), 3);
  Eigen::Index row = 0;
  for (const Eigen::RowVector3d& value : values) field.row(row++) = value;
  return field;
}

//  A tetrahedron: 3 above the triangle 0 1 2, all faces outward.
const Field3 kTetrahedron = rows({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
const Triangles kTetrahedronFaces = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

/// Three rows to a triangle, as STL has them, each moved by up to `noise` each way.
MeshAsset soup_of(const TriMesh& mesh, double noise) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> shift(-noise, noise);
  Field3 positions(3 * static_cast<Eigen::Index>(mesh.triangles.size()), 3);
  Triangles triangles;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto row = static_cast<Eigen::Index>(3 * t + corner);
      positions.row(row) = mesh.positions.row(mesh.triangles[t][corner]);
      for (int axis = 0; axis < 3; ++axis) positions(row, axis) += shift(random);
    }
    const auto first = static_cast<std::uint32_t>(3 * t);
    triangles.push_back({first, first + 1, first + 2});
  }
  return asset_of(positions, triangles);
}

TEST(WeldAndDiagnose, welded_then_unwelded_positions_are_the_sources_at_any_scale_and_far_away) {
  const TriMesh sphere = samples::sphere(1.0, 3);
  const double diagonal = bounds(sphere).diagonal();
  struct Placement {
    double scale;
    Eigen::RowVector3d offset;  // in units of the scaled mesh
  };
  const Placement placements[] = {{1, {0, 0, 0}}, {1e-12, {0, 0, 0}}, {1e12, {0, 0, 0}}, {1e-150, {0, 0, 0}},
                                  {1e150, {0, 0, 0}}, {1, {1e7, -1e7, 3e6}}, {1e-3, {0, 5e4, 0}}};
  for (const Placement& placement : placements) {
    MeshAsset asset = soup_of(sphere, 1e-7 * diagonal);
    asset.source_positions.rowwise() += placement.offset;
    asset.source_positions *= placement.scale;
    weld_and_diagnose(asset);
    ASSERT_EQ(asset.mesh.vertex_count(), sphere.vertex_count()) << placement.scale;
    EXPECT_TRUE(asset.diagnosis.closed) << placement.scale;
    for (Eigen::Index row = 0; row < asset.source_positions.rows(); ++row) {
      const int vertex = asset.vertex_of_source[static_cast<std::size_t>(row)];
      const double moved = (asset.mesh.positions.row(vertex) - asset.source_positions.row(row)).stableNorm();
      ASSERT_LE(moved, 1.01e-6 * diagonal * placement.scale);
    }
  }
}

TEST(WeldAndDiagnose, each_cluster_takes_the_position_of_its_first_row) {
  MeshAsset asset = soup_of(samples::box({1, 1, 1}, 2), 1e-7);
  weld_and_diagnose(asset);
  std::vector<bool> seen(static_cast<std::size_t>(asset.mesh.vertex_count()));
  int next = 0;
  for (Eigen::Index row = 0; row < asset.source_positions.rows(); ++row) {
    const int vertex = asset.vertex_of_source[static_cast<std::size_t>(row)];
    if (seen[static_cast<std::size_t>(vertex)]) continue;
    seen[static_cast<std::size_t>(vertex)] = true;
    EXPECT_EQ(vertex, next++) << "vertices are numbered in the order of their first rows";
    EXPECT_EQ(asset.mesh.positions.row(vertex), asset.source_positions.row(row));
  }
}

TEST(WeldAndDiagnose, agrees_with_comparing_every_pair) {
  std::mt19937 random(11);
  std::uniform_int_distribution<int> step(0, 40);
  // Points on a fine grid about as wide as the tolerance, so that many lie just within and just beyond it.
  constexpr int kRows = 600;
  Field3 positions(kRows, 3);
  for (Eigen::Index row = 0; row < kRows - 1; ++row) {
    for (int axis = 0; axis < 3; ++axis) positions(row, axis) = step(random) * 0.3e-3;
  }
  positions.row(kRows - 1) << 1, 1, 1;
  Triangles triangles;
  for (std::uint32_t i = 0; i < kRows; i += 3) triangles.push_back({i, i + 1, i + 2});
  MeshAsset asset = asset_of(positions, triangles);
  const double tolerance = 1e-3;
  weld_and_diagnose(asset, tolerance);

  const Eigen::RowVector3d extent = positions.colwise().maxCoeff() - positions.colwise().minCoeff();
  std::vector<Eigen::RowVector3d> leaders;
  for (Eigen::Index row = 0; row < kRows; ++row) {
    std::size_t leader = 0;
    while (leader < leaders.size() && (leaders[leader] - positions.row(row)).norm() > tolerance * extent.norm()) ++leader;
    if (leader == leaders.size()) leaders.push_back(positions.row(row));
    ASSERT_EQ(asset.vertex_of_source[static_cast<std::size_t>(row)], static_cast<int>(leader)) << row;
  }
}

TEST(WeldAndDiagnose, a_tetrahedron_is_closed_and_in_one_piece) {
  const MeshAsset asset = welded(kTetrahedron, kTetrahedronFaces);
  EXPECT_TRUE(asset.diagnosis.closed);
  EXPECT_TRUE(asset.diagnosis.outward);
  EXPECT_EQ(asset.diagnosis.components, 1);
  EXPECT_EQ(asset.diagnosis.welded_vertices, 4);
  EXPECT_EQ(asset.diagnosis.triangles, 4);
  EXPECT_TRUE(asset.warnings.empty());
  EXPECT_NEAR(enclosed_volume(asset.mesh, asset.mesh.positions), 1.0 / 6.0, 1e-15);
}

TEST(WeldAndDiagnose, a_missing_face_leaves_three_boundary_edges) {
  const MeshAsset asset = welded(kTetrahedron, {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}});
  EXPECT_FALSE(asset.diagnosis.closed);
  EXPECT_EQ(asset.diagnosis.boundary_edges, 3);
}

TEST(WeldAndDiagnose, a_seam_of_two_rows_at_a_vertex_is_no_boundary) {
  //  2---3 5     The two triangles meet along 1 2, which the second one calls 4 3... with rows of its own.
  //  | \ | |
  //  0--1  4
  const Field3 positions = rows({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}});
  const MeshAsset asset = welded(positions, {{0, 1, 2}, {3, 4, 5}});
  EXPECT_EQ(asset.diagnosis.welded_vertices, 4);
  EXPECT_EQ(asset.diagnosis.boundary_edges, 4);
  EXPECT_EQ(asset.diagnosis.components, 1);
  EXPECT_EQ(asset.vertex_of_source, (std::vector<int>{0, 1, 2, 2, 1, 3}));
}

TEST(WeldAndDiagnose, three_pages_of_a_book_make_its_spine_non_manifold) {
  //      3  2
  //       \ |      pages 0 1 2, 0 1 3 and 1 0 4; all share the spine 0-1
  //  4 ---- 0-1
  const Field3 positions = rows({{0, 0, 0}, {0, 0, 1}, {0, 1, 0}, {-1, 1, 0}, {-1, 0, 0}});
  const MeshAsset asset = welded(positions, {{0, 1, 2}, {0, 1, 3}, {1, 0, 4}});
  EXPECT_EQ(asset.diagnosis.non_manifold_edges, 1);
  EXPECT_EQ(asset.diagnosis.inconsistent_edges, 1) << "0 to 1 is run by two";
  EXPECT_EQ(asset.diagnosis.boundary_edges, 6);
  EXPECT_FALSE(asset.diagnosis.closed);
}

TEST(WeldAndDiagnose, a_flipped_neighbour_is_inconsistent) {
  //  2---3    0 1 2 is counter-clockwise, 1 2 3 clockwise: both run from 1 to 2.
  //  | \ |
  //  0---1
  const MeshAsset asset = welded(rows({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}}), {{0, 1, 2}, {1, 2, 3}});
  EXPECT_EQ(asset.diagnosis.inconsistent_edges, 1);
  EXPECT_EQ(asset.diagnosis.non_manifold_edges, 0);
}

TEST(WeldAndDiagnose, a_face_given_twice_is_a_duplicate_whichever_corner_leads_and_way_it_turns) {
  Triangles faces = kTetrahedronFaces;
  faces.push_back({1, 3, 0});
  faces.push_back({2, 1, 3});
  const MeshAsset asset = welded(kTetrahedron, faces);
  EXPECT_EQ(asset.diagnosis.duplicate_triangles, 2);
  EXPECT_EQ(asset.mesh.triangles.size(), 6U);
}

TEST(WeldAndDiagnose, degenerate_triangles_are_left_out_and_the_others_keep_their_order) {
  //  4 is at 1; 5 is the middle of 0 and 1.
  Field3 positions(6, 3);
  positions << kTetrahedron, 1, 0, 0, 0.5, 0, 0;
  const MeshAsset asset = welded(positions, {{0, 2, 1}, {1, 4, 3}, {0, 1, 3}, {0, 5, 1}, {1, 2, 3}, {2, 2, 3}, {2, 0, 3}});
  EXPECT_EQ(asset.diagnosis.degenerate_triangles, 3);
  EXPECT_EQ(asset.mesh.triangles, (std::vector<std::array<int, 3>>{{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}));
  EXPECT_EQ(asset.vertex_of_source, (std::vector<int>{0, 1, 2, 3, 1, 4}));
}

TEST(WeldAndDiagnose, a_triangle_without_area_still_closes_the_surface) {
  //  The face 0 1 3 is cut at 4, the middle of 0 and 1, and the face 0 2 1 is not; 0 1 4 fills the slit.
  Field3 positions(5, 3);
  positions << kTetrahedron, 0.5, 0, 0;
  const MeshAsset asset = welded(positions, {{0, 2, 1}, {0, 1, 4}, {0, 4, 3}, {4, 1, 3}, {1, 2, 3}, {2, 0, 3}});
  EXPECT_TRUE(asset.diagnosis.closed);
  EXPECT_EQ(asset.diagnosis.degenerate_triangles, 1);
  EXPECT_EQ(asset.mesh.triangles.size(), 5U);
}

TEST(WeldAndDiagnose, rows_that_no_triangle_uses_have_no_vertex_and_do_not_widen_the_box) {
  Field3 positions(5, 3);
  positions << Eigen::RowVector3d(1e9, 0, 0), kTetrahedron;
  const MeshAsset asset = welded(positions, {{1, 3, 2}, {1, 2, 4}, {2, 3, 4}, {3, 1, 4}});
  EXPECT_EQ(asset.diagnosis.unreferenced_vertices, 1);
  EXPECT_EQ(asset.vertex_of_source, (std::vector<int>{-1, 0, 1, 2, 3}));
}

TEST(WeldAndDiagnose, pieces_that_share_no_vertex_are_components) {
  Field3 positions(8, 3);
  positions << kTetrahedron, kTetrahedron.rowwise() + Eigen::RowVector3d(3, 0, 0);
  Triangles faces = kTetrahedronFaces;
  for (const auto& face : kTetrahedronFaces) faces.push_back({face[0] + 4, face[1] + 4, face[2] + 4});
  EXPECT_EQ(welded(positions, faces).diagnosis.components, 2);
}

TEST(WeldAndDiagnose, a_surface_that_faces_inward_is_turned_in_the_mesh_alone) {
  Triangles inward = kTetrahedronFaces;
  for (auto& face : inward) std::swap(face[1], face[2]);
  const MeshAsset asset = welded(kTetrahedron, inward);
  EXPECT_FALSE(asset.diagnosis.outward);
  EXPECT_GT(enclosed_volume(asset.mesh, asset.mesh.positions), 0.0);
  EXPECT_EQ(asset.primitives[0].indices[1], inward[0][1]);
  EXPECT_EQ(asset.warnings, std::vector<std::string>{"W_MESH_INWARD: the triangles face inward; turned for solving, "
                                                     "kept as they are in what is written"});
}

TEST(WeldAndDiagnose, welds_across_primitives) {
  MeshAsset asset = asset_of(kTetrahedron, {kTetrahedronFaces[0], kTetrahedronFaces[1]});
  asset.source_positions.resize(8, 3);
  asset.source_positions << kTetrahedron, kTetrahedron;
  SourcePrimitive second = asset.primitives[0];
  second.first_vertex = 4;
  second.indices = {1, 2, 3, 2, 0, 3};
  asset.primitives.push_back(second);
  weld_and_diagnose(asset);
  EXPECT_TRUE(asset.diagnosis.closed);
  EXPECT_EQ(asset.mesh.vertex_count(), 4);
}

TEST(WeldAndDiagnose, refuses_what_has_no_surface) {
  EXPECT_EQ(refusal([] { welded(kTetrahedron, {}); }), "made.obj: no triangles; a mesh needs a surface");
  EXPECT_EQ(refusal([] { welded(rows({{1, 2, 3}, {1, 2, 3}, {1, 2, 3}}), {{0, 1, 2}}); }),
            "made.obj: all vertices lie at one point; a mesh needs a surface");
  EXPECT_EQ(refusal([] { welded(rows({{0, 0, 0}, {1, 1, 1}, {3, 3, 3}}), {{0, 1, 2}}); }),
            "made.obj: no triangle has an area; a mesh needs a surface");
  EXPECT_EQ(refusal([] { welded(rows({{-1e308, 0, 0}, {1e308, 0, 0}, {0, 1e308, 0}}), {{0, 1, 2}}); }),
            "made.obj: coordinates are too far apart to be measured");
  MeshAsset asset = asset_of(kTetrahedron, kTetrahedronFaces);
  EXPECT_THROW(weld_and_diagnose(asset, 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace sinew
