#include "pipeline/volume_graph.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

#include "samples/shapes.h"
#include "skeleton/unusable_input.h"
#include "solver/laplacian.h"
#include "tests/pipeline/damage.h"
#include "tests/pipeline/plain_obj.h"

namespace sinew {
namespace {

using Eigen::Vector3d;

VolumeGraph build(const TriMesh& mesh, const VolumeGraphOptions& options = {}, int threads = 1) {
  ThreadTeam team(threads);
  return build_volume_graph(mesh, Solid(mesh), options, team);
}

struct NamedMesh {
  std::string name;
  TriMesh mesh;
};

std::vector<NamedMesh> closed_shapes() {
  return {
      {"box", samples::box({1.0, 2.0, 3.0}, 6)},     {"sphere", samples::sphere(1.0, 3)},
      {"torus", samples::torus(1.0, 0.3, 48, 20)},   {"tube", samples::tube({{0, 0, 0}, {3, 0, 0}}, 0.4, 24)},
      {"bent arm", samples::arm(2.0, 0.2, 1.3, 20)}, {"two legs", samples::two_legs(1.0, 0.1, 0.01, 20)}};
}

/// Real bodies, closed and broken. Their licences keep them out of the project; tests without them are
/// skipped.
std::vector<NamedMesh> real_bodies() {
  std::vector<NamedMesh> bodies;
  for (const char* path : {"meshes/odedstein/human_man.obj", "meshes/libigl/armadillo.obj",
                           "meshes/odedstein/koala.obj", "meshes/sumner-popovic/camel_ref.obj",
                           "bad/cgal/elephant-with-holes.off", "bad/cgal/blobby_3cc.off"}) {
    TriMesh mesh = read_plain_mesh(std::string(SINEW_SHARED_DATA) + "/" + path);
    if (!mesh.triangles.empty()) bodies.push_back({path, std::move(mesh)});
  }
  return bodies;
}

Vector3d position(const VolumeGraph& volume, int node) {
  return volume.rest_positions.row(node);
}

/// Calls visit(a, b) for every edge, a < b.
template <typename Visit>
void for_each_edge(const VolumeGraph& volume, const Visit& visit) {
  for (int node = 0; node < volume.node_count(); ++node) {
    for (const int neighbor : volume.graph.neighbors_of(node)) {
      if (node < neighbor) visit(node, neighbor);
    }
  }
}

int surface_components(const TriMesh& mesh) {
  return connected_components(build(mesh, {.interior = Interior::none}).graph).count;
}

void expect_same_graph(const VolumeGraph& a, const VolumeGraph& b) {
  EXPECT_EQ(a.graph.offsets, b.graph.offsets);
  EXPECT_EQ(a.graph.neighbors, b.graph.neighbors);
  EXPECT_EQ(a.graph.weights, b.graph.weights);
}

TEST(VolumeGraph, BeginsWithTheSurfaceAndAllItsEdges) {
  for (const auto& [name, mesh] : closed_shapes()) {
    for (const Interior interior : {Interior::lattice, Interior::none}) {
      const VolumeGraph volume = build(mesh, {.interior = interior});
      EXPECT_EQ(volume.interior, interior);
      EXPECT_TRUE(volume.warnings.empty());
      ASSERT_EQ(volume.surface_count, mesh.vertex_count());
      EXPECT_EQ(volume.rest_positions.rows(), volume.node_count());
      EXPECT_EQ(volume.rest_positions.topRows(mesh.vertex_count()), mesh.positions);
      for (const auto& triangle : mesh.triangles) {
        const auto neighbors = volume.graph.neighbors_of(triangle[0]);
        EXPECT_TRUE(std::binary_search(neighbors.begin(), neighbors.end(), triangle[1])) << name;
      }
    }
  }
}

TEST(VolumeGraph, WithoutInteriorHasTheSurfaceEdgesAlone) {
  const TriMesh mesh = samples::sphere(1.0, 2);
  const VolumeGraph volume = build(mesh, {.interior = Interior::none});
  EXPECT_EQ(volume.node_count(), mesh.vertex_count());
  EXPECT_EQ(volume.graph.edge_count(), static_cast<std::int64_t>(mesh.triangles.size()) * 3 / 2);
  EXPECT_EQ(volume.spacing, 0.0);
}

TEST(VolumeGraph, HasUniformWeights) {
  for (const double weight : build(samples::sphere(1.0, 2)).graph.weights) EXPECT_EQ(weight, 1.0);
}

/// A flat strip in columns at `places` of x, four rows high.
TriMesh strip(const std::vector<double>& places) {
  constexpr int kRows = 4;
  const int columns = static_cast<int>(places.size());
  TriMesh mesh;
  mesh.positions.resize(columns * kRows, 3);
  for (int column = 0; column < columns; ++column) {
    for (int row = 0; row < kRows; ++row)
      mesh.positions.row(column * kRows + row) << places[column], row, 0.0;
  }
  for (int column = 0; column + 1 < columns; ++column) {
    for (int row = 0; row + 1 < kRows; ++row) {
      const int a = column * kRows + row, b = a + kRows;
      mesh.triangles.push_back({a, b, b + 1});
      mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
  return mesh;
}

/// Harmonic along the graph, 0 at x = 0 and 1 at the largest x.
Eigen::VectorXd slope(const VolumeGraph& volume) {
  const double end = volume.rest_positions.col(0).maxCoeff();
  Eigen::MatrixXd A(laplacian(volume.graph));
  Eigen::VectorXd b = Eigen::VectorXd::Zero(A.rows());
  for (int node = 0; node < volume.node_count(); ++node) {
    const double x = volume.rest_positions(node, 0);
    if (x > 0.0 && x < end) continue;
    A.row(node).setZero();
    A(node, node) = 1.0;
    b[node] = x == end ? 1.0 : 0.0;
  }
  return A.partialPivLu().solve(b);
}

TEST(VolumeGraph, ANarrowSeamTakesNoMoreOfAMotionThanItsWidth) {
  const VolumeGraph volume = build(strip({0, 1, 2, 3, 3.1, 4.1, 5.1, 6.1}), {.interior = Interior::none});
  const Eigen::VectorXd motion = slope(volume);
  constexpr int kBefore = 3 * 4 + 1, kAfter = 4 * 4 + 1;  // row 1 of the columns beside the seam
  const double across_seam = motion[kAfter] - motion[kBefore];
  const double across_column = motion[kBefore] - motion[kBefore - 4];
  EXPECT_GE(across_seam, 0.0);
  EXPECT_LT(across_seam, 0.3 * across_column);
}

TEST(VolumeGraph, TheEndsOfAShortEdgeHaveEachOthersNeighbors) {
  TriMesh mesh = samples::sphere(1.0, 2);
  const int end = mesh.triangles[100][0], other = mesh.triangles[100][1];
  mesh.positions.row(end) = 0.1 * mesh.positions.row(end) + 0.9 * mesh.positions.row(other);
  for (const Interior interior : {Interior::none, Interior::lattice}) {
    const VolumeGraph volume = build(mesh, {.interior = interior, .spacing = 0.2});
    const auto of_end = volume.graph.neighbors_of(end);
    const auto of_other = volume.graph.neighbors_of(other);
    EXPECT_EQ(of_end.size(), of_other.size()) << "a convex body: no way between them leaves it";
    for (const int neighbor : of_end) {
      EXPECT_TRUE(neighbor == other || std::binary_search(of_other.begin(), of_other.end(), neighbor));
    }
  }
}

TEST(VolumeGraph, OfAFanWithManyShortSpokesStaysLinear) {
  // Every other spoke is short. Sharing the pole's neighbors would give each of them half a thousand more.
  constexpr int kSpokes = 1000;
  TriMesh mesh;
  mesh.positions.resize(kSpokes + 1, 3);
  mesh.positions.row(kSpokes).setZero();
  for (int k = 0; k < kSpokes; ++k) {
    const double angle = 2.0 * 3.14159265358979 * k / kSpokes;
    const double radius = k % 2 == 0 ? 1.0 : 0.05;
    mesh.positions.row(k) << radius * std::cos(angle), radius * std::sin(angle), 0.0;
    mesh.triangles.push_back({k, (k + 1) % kSpokes, kSpokes});
  }
  const VolumeGraph volume = build(mesh, {.interior = Interior::none});
  EXPECT_LT(volume.graph.edge_count(), 6 * kSpokes);
}

TEST(VolumeGraph, OfAConnectedSurfaceIsConnected) {
  for (const auto& [name, mesh] : closed_shapes()) {
    EXPECT_EQ(connected_components(build(mesh).graph).count, 1) << name;
  }
}

TEST(VolumeGraph, KeepsEveryNodeAndEveryEdgeInsideTheBody) {
  for (const auto& [name, mesh] : closed_shapes()) {
    const Solid solid(mesh);
    const VolumeGraph volume = build(mesh);
    ASSERT_GT(volume.node_count(), volume.surface_count) << name;
    for (int node = volume.surface_count; node < volume.node_count(); ++node) {
      EXPECT_TRUE(solid.contains(position(volume, node))) << name;
      EXPECT_GE(solid.distance(position(volume, node)), 0.299 * volume.spacing) << name;
    }
    for_each_edge(volume, [&](int a, int b) {
      const Vector3d middle = (position(volume, a) + position(volume, b)) / 2.0;
      // Surface vertices that share neighbors over a short edge may have its width of outside between them.
      const double width = std::max(a, b) < volume.surface_count ? 0.4 * mean_edge_length(mesh) : 1e-9;
      EXPECT_TRUE(solid.distance(middle) < width || solid.contains(middle)) << name << ' ' << a << ' ' << b;
    });
  }
}

TEST(VolumeGraph, LatticeNodesAwayFromTheSurfaceHaveFourteenNeighbors) {
  const TriMesh mesh = samples::sphere(1.0, 3);
  const Solid solid(mesh);
  const VolumeGraph volume = build(mesh);
  int deep = 0;
  for (int node = volume.surface_count; node < volume.node_count(); ++node) {
    if (solid.distance(position(volume, node)) < 1.9 * volume.spacing) continue;
    ++deep;
    ASSERT_EQ(volume.graph.degree(node), 14);
    int near = 0;
    for (const int neighbor : volume.graph.neighbors_of(node)) {
      const double distance = (position(volume, neighbor) - position(volume, node)).norm() / volume.spacing;
      const bool nearest = std::abs(distance - std::sqrt(0.75)) < 1e-9;
      EXPECT_TRUE(nearest || std::abs(distance - 1.0) < 1e-9);
      near += nearest;
    }
    EXPECT_EQ(near, 8);
  }
  EXPECT_GT(deep, 50);
}

TEST(VolumeGraph, LinksEverySurfaceVertexOfAThickBodyToItsNearestNodesBelow) {
  const VolumeGraph volume = build(samples::sphere(1.0, 3));
  for (int vertex = 0; vertex < volume.surface_count; ++vertex) {
    int links = 0;
    for (const int neighbor : volume.graph.neighbors_of(vertex)) {
      if (neighbor < volume.surface_count) continue;
      ++links;
      EXPECT_LE((position(volume, neighbor) - position(volume, vertex)).norm(), 1.39 * volume.spacing);
    }
    EXPECT_GE(links, 1);
    EXPECT_LE(links, 4);
  }
}

TEST(VolumeGraph, NoEdgeCrossesANarrowGapBetweenTwoLegs) {
  const double radius = 0.1;
  // The wider spacings let links reach through a leg, over the gap and into the other leg.
  for (const double spacing : {0.0, 0.1, 0.14}) {
    for (const double gap : {0.1, 0.01, 0.001}) {
      const VolumeGraph volume = build(samples::two_legs(1.0, radius, gap, 24), {.spacing = spacing});
      for_each_edge(volume, [&](int a, int b) {
        const Vector3d from = position(volume, a), to = position(volume, b);
        if ((from.x() < 0.0) == (to.x() < 0.0)) return;
        const double height = from.y() + from.x() / (from.x() - to.x()) * (to.y() - from.y());
        EXPECT_GT(height, -radius - 1e-9) << "gap " << gap << ", nodes " << a << ' ' << b;
      });
    }
  }
}

TEST(VolumeGraph, PutsNothingWhereABodyOverlapsItself) {
  // The last piece of the tube runs through its first.
  const double radius = 0.2;
  const TriMesh mesh =
      samples::tube({{-1, 0, 0}, {1.5, 0, 0}, {1.5, 1.5, 0}, {0, 1.5, 0}, {0, -1, 0}}, radius, 16);
  ASSERT_TRUE(Solid(mesh).contains({0.01, 0.02, 0.03}));
  const VolumeGraph volume = build(mesh, {.spacing = 0.08});
  int near = 0, buried = 0;
  for (int node = volume.surface_count; node < volume.node_count(); ++node) {
    const Vector3d at = position(volume, node);
    const double from_first = std::hypot(at.y(), at.z()), from_last = std::hypot(at.x(), at.z());
    near += from_first < radius && std::abs(at.x()) < 2.0 * radius;
    EXPECT_FALSE(from_first < 0.9 * radius && from_last < 0.9 * radius) << at.transpose();
  }
  EXPECT_GT(near, 20);
  // What is left of each piece there has no edge to the other: the way from one to the other is the long way
  // round.
  for_each_edge(volume, [&](int a, int b) {
    const Vector3d from = position(volume, a), to = position(volume, b);
    const auto in_first = [&](const Vector3d& at) {
      return std::abs(at.x()) > 1.05 * radius && std::abs(at.y()) < radius;
    };
    const auto in_last = [&](const Vector3d& at) {
      return std::abs(at.y()) > 1.05 * radius && std::abs(at.x()) < radius;
    };
    EXPECT_FALSE((in_first(from) && in_last(to)) || (in_last(from) && in_first(to)));
  });
  // Vertices of the first piece that lie within the last have no business with the nodes round them.
  for (int vertex = 0; vertex < volume.surface_count; ++vertex) {
    const Vector3d at = position(volume, vertex);
    const bool of_first = std::abs(at.x()) < radius && std::abs(std::hypot(at.y(), at.z()) - radius) < 1e-9;
    if (!of_first || std::hypot(at.x(), at.z()) > 0.9 * radius) continue;
    ++buried;
    for (const int neighbor : volume.graph.neighbors_of(vertex)) {
      EXPECT_LE(std::hypot(position(volume, neighbor).y(), position(volume, neighbor).z()), 1.001 * radius);
    }
  }
  EXPECT_GT(buried, 5);
}

TEST(VolumeGraph, JoinsTheTwoSidesOfAPlateTooThinForTheLattice) {
  const VolumeGraph volume = build(samples::box({1.0, 1.0, 0.01}, 12));
  EXPECT_EQ(volume.node_count(), volume.surface_count);
  ASSERT_EQ(volume.warnings.size(), 1u);
  EXPECT_EQ(volume.warnings[0].substr(0, 15), "W_NO_INTERIOR: ");
  for (int vertex = 0; vertex < volume.surface_count; ++vertex) {
    const Vector3d at = position(volume, vertex);
    if (at.head<2>().cwiseAbs().maxCoeff() > 0.49) continue;  // the rim
    const auto neighbors = volume.graph.neighbors_of(vertex);
    EXPECT_TRUE(std::any_of(neighbors.begin(), neighbors.end(), [&](int neighbor) {
      return position(volume, neighbor).z() * at.z() < 0.0;
    })) << at.transpose();
  }
}

TEST(VolumeGraph, MovesAndScalesWithTheMesh) {
  for (const auto& [name, mesh] : closed_shapes()) {
    const VolumeGraph volume = build(mesh);
    for (const double scale : {1e-9, 3.7, 1e9}) {
      const Vector3d by = scale * Vector3d(10.0, -20.0, 5.0);
      const VolumeGraph other = build(moved(mesh, scale, by));
      EXPECT_NEAR(other.spacing / volume.spacing, scale, 1e-9 * scale);
      ASSERT_EQ(other.node_count(), volume.node_count()) << name;
      EXPECT_EQ(other.graph.neighbors, volume.graph.neighbors) << name << ' ' << scale;
      const Field3 expected = (scale * volume.rest_positions).rowwise() + by.transpose();
      EXPECT_LT((other.rest_positions - expected).cwiseAbs().maxCoeff(), 1e-9 * scale) << name;
    }
  }
}

TEST(VolumeGraph, DefaultSpacingPutsNearestNeighborsOneAndAQuarterSurfaceEdgesApart) {
  const TriMesh mesh = samples::sphere(1.0, 3);
  EXPECT_NEAR(build(mesh).spacing * std::sqrt(0.75), 1.25 * mean_edge_length(mesh), 1e-12);
}

TEST(VolumeGraph, DefaultSpacingIsWiderWhereTheSurfaceIsSoDenseThatTheInsideWouldBeOverfull) {
  const TriMesh mesh = samples::sphere(1.0, 6);
  const VolumeGraph volume = build(mesh);
  EXPECT_GT(volume.spacing * std::sqrt(0.75), 1.25 * mean_edge_length(mesh));
  EXPECT_NEAR(static_cast<double>(volume.node_count() - volume.surface_count) / mesh.vertex_count(), 5.0,
              0.5);
}

TEST(VolumeGraph, KeepsTheSpacingItIsGiven) {
  EXPECT_EQ(build(samples::sphere(1.0, 3), {.spacing = 0.123, .density = 5.0}).spacing, 0.123);
}

TEST(VolumeGraph, MeetsTheDensityWithinTenPercent) {
  for (const auto& [name, mesh] : closed_shapes()) {
    for (const double density : {1.0, 4.0, 10.0}) {
      const VolumeGraph volume = build(mesh, {.density = density});
      const double met =
          static_cast<double>(volume.node_count() - volume.surface_count) / mesh.vertex_count();
      EXPECT_NEAR(met / density, 1.0, 0.1) << name << ' ' << density;
    }
  }
}

TEST(VolumeGraph, IsTheSameForAnyNumberOfThreads) {
  const TriMesh mesh = without_triangles(samples::two_legs(1.0, 0.1, 0.01, 32), 0.02);
  const VolumeGraph one = build(mesh, {.density = 5.0}, 1);
  for (const int threads : {2, 4}) {
    const VolumeGraph several = build(mesh, {.density = 5.0}, threads);
    expect_same_graph(one, several);
    EXPECT_EQ(one.rest_positions, several.rest_positions);
    EXPECT_EQ(one.spacing, several.spacing);
  }
}

TEST(VolumeGraph, SurvivesDamageWithAlmostTheSameInterior) {
  for (const auto& [name, mesh] : closed_shapes()) {
    const double spacing = build(mesh).spacing;
    const int whole = build(mesh, {.spacing = spacing}).node_count();
    for (const TriMesh& damaged : {without_triangles(mesh, 0.05), with_flipped_triangles(mesh, 0.05)}) {
      const VolumeGraph volume = build(damaged, {.spacing = spacing});
      EXPECT_NEAR(volume.node_count(), whole, 0.05 * whole) << name;
      EXPECT_EQ(connected_components(volume.graph).count, surface_components(damaged)) << name;
    }
  }
}

TEST(VolumeGraph, OfADamagedBodyStaysInsideTheWholeOne) {
  for (const double gap : {0.01, 0.05}) {
    const TriMesh mesh = samples::two_legs(1.0, 0.1, gap, 32);
    const Solid whole(mesh);
    const VolumeGraph volume = build(without_triangles(mesh, 0.05));
    for_each_edge(volume, [&](int a, int b) {
      if (b < volume.surface_count) return;
      const Vector3d middle = (position(volume, a) + position(volume, b)) / 2.0;
      EXPECT_TRUE(whole.contains(middle) || whole.distance(middle) < 0.01) << middle.transpose();
    });
  }
}

TEST(VolumeGraph, OfABodyInsideOutIsTheSame) {
  const TriMesh mesh = samples::arm(2.0, 0.2, 1.3, 20);
  expect_same_graph(build(mesh), build(with_flipped_triangles(mesh, 1.0)));
}

TEST(VolumeGraph, LeavesAVertexWithoutTrianglesAlone) {
  TriMesh mesh = samples::sphere(1.0, 2);
  mesh.positions.conservativeResize(mesh.vertex_count() + 1, 3);
  mesh.positions.bottomRows(1) << 0.1, 0.2, 0.3;
  const VolumeGraph volume = build(mesh);
  EXPECT_EQ(volume.graph.degree(mesh.vertex_count() - 1), 0);
  EXPECT_EQ(connected_components(volume.graph).count, 2);
}

TEST(VolumeGraph, OfDegenerateTrianglesHasTheEdgesThatAreLeft) {
  TriMesh mesh;
  mesh.positions.resize(3, 3);
  mesh.positions << 0, 0, 0, 1, 0, 0, 2, 0, 0;
  mesh.triangles = {{0, 1, 1}, {0, 1, 2}};
  const VolumeGraph volume = build(mesh);
  EXPECT_EQ(volume.node_count(), 3);
  EXPECT_EQ(volume.graph.edge_count(), 3);
}

TEST(VolumeGraph, OfRealBodiesIsConnectedAsTheirSurfacesAre) {
  const std::vector<NamedMesh> bodies = real_bodies();
  if (bodies.empty()) GTEST_SKIP() << "no real meshes at " << SINEW_SHARED_DATA;
  for (const auto& [name, mesh] : bodies) {
    const VolumeGraph volume = build(mesh);
    EXPECT_EQ(connected_components(volume.graph).count, surface_components(mesh)) << name;
    EXPECT_GT(volume.node_count(), 1.5 * volume.surface_count) << name;
    EXPECT_TRUE(volume.warnings.empty()) << name;
  }
}

template <typename Error>
void expect_refusal(const TriMesh& mesh, const VolumeGraphOptions& options, const std::string& message) {
  try {
    ThreadTeam team(1);
    build_volume_graph(mesh, Solid(samples::box({2, 2, 2}, 2)), options, team);
    FAIL() << "expected: " << message;
  } catch (const Error& error) {
    EXPECT_EQ(error.what(), message);
  }
}

TEST(VolumeGraphRefuses, AMeshWithoutTriangles) {
  expect_refusal<UnusableInput>({}, {}, "volume graph: the mesh has no triangles; expected a surface");
}

TEST(VolumeGraphRefuses, ACoordinateThatIsNotANumber) {
  TriMesh mesh = samples::box({2, 2, 2}, 2);
  mesh.positions(5, 1) = std::numeric_limits<double>::quiet_NaN();
  expect_refusal<UnusableInput>(mesh, {},
                                "volume graph: vertex 5 has a coordinate that is not a finite number");
}

TEST(VolumeGraphRefuses, ATriangleThatNamesNoVertex) {
  TriMesh mesh = samples::box({2, 2, 2}, 2);
  mesh.triangles[7] = {0, 1, -1};
  expect_refusal<std::invalid_argument>(mesh, {},
                                        "build_volume_graph: triangle 7 names vertex -1; expected 0 to 25");
}

TEST(VolumeGraphRefuses, ASurfaceShrunkToAPoint) {
  TriMesh mesh = samples::box({2, 2, 2}, 2);
  mesh.positions.setConstant(3.0);
  expect_refusal<UnusableInput>(
      mesh, {}, "volume graph: all triangles of the mesh are single points; expected a surface");
}

TEST(VolumeGraphRefuses, ANegativeSpacingOrDensity) {
  const TriMesh mesh = samples::box({2, 2, 2}, 2);
  expect_refusal<std::invalid_argument>(
      mesh, {.spacing = -0.5}, "build_volume_graph: spacing is -0.500000; expected 0 or a positive number");
  expect_refusal<std::invalid_argument>(
      mesh, {.density = -1.0}, "build_volume_graph: density is -1.000000; expected 0 or a positive number");
}

TEST(VolumeGraphRefuses, MoreNodesThanTheLimitBeforeMemoryIsTouched) {
  const TriMesh mesh = samples::box({2, 2, 2}, 2);
  expect_refusal<UnusableInput>(
      mesh, {.spacing = 1e-9},
      "volume graph: a lattice spacing of 1e-09 would need about 1.621e+28 interior nodes, "
      "more than the limit of 20000000; ask for a larger spacing or a lower density");
}

TEST(VolumeGraphRefuses, NoMoreThanTheLimitAsksFor) {
  const TriMesh mesh = samples::box({2, 2, 2}, 2);
  EXPECT_NO_THROW(build(mesh, {.spacing = 0.2, .max_nodes = 2000}));
  EXPECT_THROW(build(mesh, {.spacing = 0.1, .max_nodes = 2000}), UnusableInput);
}

}  // namespace
}  // namespace sinew
