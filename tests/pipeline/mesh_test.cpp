#include "pipeline/mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <string>

#include "pipeline/hole_lids.h"
#include "samples/shapes.h"

namespace sinew {
namespace {

using Eigen::Vector3d;
using std::numbers::pi;

/// Every sample with the volume its smooth original encloses.
struct Shape {
  std::string name;
  TriMesh mesh;
  double volume;
};

std::vector<Shape> all_shapes() {
  return {{"box", samples::box({1.0, 2.0, 3.0}, 5), 6.0},
          {"sphere", samples::sphere(1.5, 4), 4.0 / 3.0 * pi * 1.5 * 1.5 * 1.5},
          {"torus", samples::torus(1.0, 0.3, 96, 48), 2.0 * pi * pi * 0.3 * 0.3},
          {"tube", samples::tube({{0, 0, 0}, {2, 0, 0}}, 0.5, 64), pi * 0.25 * 2.0 + 4.0 / 3.0 * pi * 0.125},
          {"bent arm", samples::arm(2.0, 0.1, 1.2, 64), pi * 0.01 * 2.0 + 4.0 / 3.0 * pi * 0.001},
          {"two legs", samples::two_legs(1.0, 0.1, 0.02, 64), pi * 0.01 * 2.22 + 4.0 / 3.0 * pi * 0.001}};
}

TEST(Shapes, AreClosedSoThatNoHoleIsLeftToCover) {
  for (const Shape& shape : all_shapes())
    EXPECT_TRUE(close_holes(shape.mesh).triangles.empty()) << shape.name;
}

TEST(Shapes, EncloseTheVolumeOfTheirSmoothOriginals) {
  for (const Shape& shape : all_shapes()) {
    EXPECT_NEAR(enclosed_volume(shape.mesh, shape.mesh.positions) / shape.volume, 1.0, 0.01) << shape.name;
  }
}

TEST(Shapes, UseEveryVertexAndNoneTwice) {
  for (const Shape& shape : all_shapes()) {
    std::vector<int> uses(shape.mesh.vertex_count(), 0);
    for (const auto& triangle : shape.mesh.triangles) {
      for (const int vertex : triangle) ++uses.at(vertex);
    }
    std::map<std::array<long, 3>, int> places;
    for (int vertex = 0; vertex < shape.mesh.vertex_count(); ++vertex) {
      EXPECT_GE(uses[vertex], 3) << shape.name;
      const Vector3d micrometres = 1e6 * shape.mesh.positions.row(vertex).transpose();
      ++places[{std::lround(micrometres.x()), std::lround(micrometres.y()), std::lround(micrometres.z())}];
    }
    EXPECT_EQ(static_cast<int>(places.size()), shape.mesh.vertex_count()) << shape.name;
  }
}

TEST(Shapes, HaveMoreVerticesAtAHigherResolution) {
  EXPECT_EQ(samples::sphere(1.0, 0).vertex_count(), 12);
  EXPECT_EQ(samples::sphere(1.0, 3).vertex_count(), 642);
  EXPECT_EQ(samples::box({1, 1, 1}, 1).vertex_count(), 8);
  EXPECT_EQ(samples::box({1, 1, 1}, 2).vertex_count(), 26);
  EXPECT_LT(samples::arm(1.0, 0.1, 0.5, 8).vertex_count(), samples::arm(1.0, 0.1, 0.5, 16).vertex_count());
}

TEST(Mesh, BoundsLeaveOutVerticesThatNoTriangleUses) {
  TriMesh mesh = samples::box({2.0, 4.0, 6.0}, 1);
  mesh.positions.conservativeResize(mesh.vertex_count() + 1, 3);
  mesh.positions.bottomRows(1).setConstant(100.0);
  const BoundingBox box = bounds(mesh);
  EXPECT_EQ(box.low, Vector3d(-1.0, -2.0, -3.0));
  EXPECT_EQ(box.high, Vector3d(1.0, 2.0, 3.0));
}

TEST(Mesh, AMeshWithoutTrianglesHasNoExtentVolumeOrEdges) {
  const TriMesh mesh;
  EXPECT_EQ(bounds(mesh).diagonal(), 0.0);
  EXPECT_EQ(enclosed_volume(mesh, mesh.positions), 0.0);
  EXPECT_EQ(mean_edge_length(mesh), 0.0);
}

TEST(Mesh, EnclosedVolumeKeepsItsDigitsFarFromTheOrigin) {
  TriMesh mesh = samples::box({1.0, 1.0, 1.0}, 3);
  mesh.positions.rowwise() += Eigen::RowVector3d(1e6, -1e6, 1e6);
  EXPECT_NEAR(enclosed_volume(mesh, mesh.positions), 1.0, 1e-8);
}

TEST(Mesh, EnclosedVolumeGrowsWithTheCubeOfTheScaleAndTurnsItsSignInsideOut) {
  TriMesh mesh = samples::sphere(1.0, 2);
  const double volume = enclosed_volume(mesh, mesh.positions);
  EXPECT_NEAR(enclosed_volume(mesh, 2.0 * mesh.positions), 8.0 * volume, 1e-12);
  for (auto& triangle : mesh.triangles) std::swap(triangle[0], triangle[1]);
  EXPECT_NEAR(enclosed_volume(mesh, mesh.positions), -volume, 1e-12);
}

TEST(Mesh, MeanEdgeLengthOfACubeOfTwelveTriangles) {
  // Each triangle has two sides of the cube and one diagonal.
  EXPECT_NEAR(mean_edge_length(samples::box({1, 1, 1}, 1)), (2.0 + std::sqrt(2.0)) / 3.0, 1e-15);
}

}  // namespace
}  // namespace sinew
