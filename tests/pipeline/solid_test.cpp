#include "pipeline/solid.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>
#include <thread>

#include "samples/shapes.h"
#include "tests/pipeline/damage.h"

namespace sinew {
namespace {

using Eigen::Vector3d;

constexpr int kPoints = 4000;

double sphere_depth(const Vector3d& point) {
  return 1.0 - point.norm();
}
double torus_depth(const Vector3d& point) {
  return 0.3 - std::hypot(std::hypot(point.x(), point.z()) - 1.0, point.y());
}

/// Random points whose verdict differs from the sign of `depth`; those as near to the smooth surface
/// as its triangles are left out.
int wrong_verdicts(const TriMesh& mesh, const std::function<double(const Vector3d&)>& depth, double near) {
  const Solid solid(mesh);
  int wrong = 0;
  for (const Vector3d& point : random_points(bounds(mesh), kPoints)) {
    if (std::abs(depth(point)) < near) continue;
    wrong += solid.contains(point) != (depth(point) > 0.0);
  }
  return wrong;
}

const TriMesh& fine_sphere() {
  static const TriMesh mesh = samples::sphere(1.0, 4);
  return mesh;
}
const TriMesh& fine_torus() {
  static const TriMesh mesh = samples::torus(1.0, 0.3, 96, 48);
  return mesh;
}

TEST(SolidContains, AgreesWithTheFormulaOfASphereAndATorus) {
  EXPECT_EQ(wrong_verdicts(fine_sphere(), sphere_depth, 0.002), 0);
  EXPECT_EQ(wrong_verdicts(fine_torus(), torus_depth, 0.002), 0);
}

TEST(SolidContains, StillAgreesWhenATenthOfTheTrianglesIsGone) {
  EXPECT_LE(wrong_verdicts(without_triangles(fine_sphere(), 0.1), sphere_depth, 0.02), kPoints / 1000);
  EXPECT_LE(wrong_verdicts(without_triangles(fine_torus(), 0.1), torus_depth, 0.02), kPoints / 1000);
}

TEST(SolidContains, StillAgreesWhenATenthOfTheTrianglesIsTurnedTheWrongWay) {
  EXPECT_LE(wrong_verdicts(with_flipped_triangles(fine_sphere(), 0.1), sphere_depth, 0.02), kPoints / 1000);
  EXPECT_LE(wrong_verdicts(with_flipped_triangles(fine_torus(), 0.1), torus_depth, 0.02), kPoints / 1000);
}

TEST(SolidContains, DoesNotCareWhichWayTheWholeSurfaceIsTurned) {
  EXPECT_EQ(wrong_verdicts(with_flipped_triangles(fine_torus(), 1.0), torus_depth, 0.002), 0);
}

TEST(SolidContains, DoesNotCareAboutSizeAndPlace) {
  for (const double scale : {1e-12, 1.0, 1e12}) {
    const Vector3d by = scale * Vector3d(1e4, -3e4, 7e3);
    const auto depth = [&](const Vector3d& point) { return torus_depth((point - by) / scale); };
    EXPECT_EQ(wrong_verdicts(moved(fine_torus(), scale, by), depth, 0.002), 0) << scale;
  }
}

TEST(SolidContains, ASurfaceModelledFromBothSidesIsInsideOnce) {
  TriMesh mesh = fine_sphere();
  for (auto triangle : fine_sphere().triangles) {
    std::swap(triangle[1], triangle[2]);
    mesh.triangles.push_back(triangle);
  }
  EXPECT_EQ(wrong_verdicts(mesh, sphere_depth, 0.002), 0);
}

TEST(SolidContains, WhereTwoBodiesOverlapIsInside) {
  const Vector3d aside(0.8, 0.0, 0.0);
  const TriMesh mesh = joined(fine_sphere(), moved(fine_sphere(), 1.0, aside));
  const auto depth = [&](const Vector3d& point) {
    return std::max(sphere_depth(point), sphere_depth(point - aside));
  };
  EXPECT_EQ(wrong_verdicts(mesh, depth, 0.002), 0);
}

TEST(SolidContains, AShellWithinAShellIsACavityOnlyWhenItIsTurnedInward) {
  const TriMesh inner = moved(fine_sphere(), 0.5, Vector3d::Zero());
  EXPECT_TRUE(Solid(joined(fine_sphere(), inner)).contains({0.1, 0.2, 0.1}));
  const Solid hollow(joined(fine_sphere(), with_flipped_triangles(inner, 1.0)));
  EXPECT_FALSE(hollow.contains({0.1, 0.2, 0.1}));
  EXPECT_TRUE(hollow.contains({0.5, 0.5, 0.2}));
}

TEST(SolidContains, AnOpenTubeIsInsideUpToTheLidsOnItsEnds) {
  TriMesh mesh = samples::tube({{0, 0, 0}, {4, 0, 0}}, 0.5, 32);
  std::erase_if(mesh.triangles, [&](const auto& triangle) {
    return std::any_of(triangle.begin(), triangle.end(), [&](int vertex) {
      return mesh.positions(vertex, 0) < 1.0 || mesh.positions(vertex, 0) > 3.0;
    });
  });
  const Solid solid(mesh);
  EXPECT_FALSE(solid.closed());
  EXPECT_TRUE(solid.contains({2.0, 0.1, -0.2}));
  EXPECT_TRUE(solid.contains({1.2, 0.0, 0.0}));
  EXPECT_FALSE(solid.contains({0.5, 0.0, 0.0}));
  EXPECT_FALSE(solid.contains({2.0, 0.6, 0.0}));
}

TEST(SolidContains, NothingIsInsideAFlatSheet) {
  TriMesh sheet = samples::box({1, 1, 1}, 4);
  std::erase_if(sheet.triangles, [&](const auto& triangle) {
    return std::any_of(triangle.begin(), triangle.end(),
                       [&](int vertex) { return sheet.positions(vertex, 2) < 0.4; });
  });
  const Solid solid(sheet);
  for (const Vector3d& point : random_points({Vector3d::Constant(-1), Vector3d::Constant(1)}, 500)) {
    EXPECT_FALSE(solid.contains(point));
  }
}

TEST(SolidContains, APointThatIsNotANumberIsOutside) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Solid(fine_sphere()).contains({nan, 0.0, 0.0}));
}

TEST(SolidClosed, IsTrueOfClosedSurfacesTurnedOneWay) {
  EXPECT_TRUE(Solid(fine_sphere()).closed());
  EXPECT_TRUE(Solid(with_flipped_triangles(fine_sphere(), 1.0)).closed());
  EXPECT_FALSE(Solid(with_flipped_triangles(fine_sphere(), 0.1)).closed());
  EXPECT_FALSE(Solid(without_triangles(fine_sphere(), 0.1)).closed());
}

TEST(SolidDistance, AgreesWithTheFormulaOfABox) {
  const Solid solid(samples::box({2, 2, 2}, 3));
  for (const Vector3d& point : random_points({Vector3d::Constant(-3), Vector3d::Constant(3)}, 1000)) {
    const Vector3d beyond = (point.cwiseAbs().array() - 1.0).matrix();
    const double expected = beyond.maxCoeff() < 0.0 ? -beyond.maxCoeff() : beyond.cwiseMax(0.0).norm();
    EXPECT_NEAR(solid.distance(point), expected, 1e-12);
    EXPECT_NEAR((solid.nearest(point) - point).norm(), expected, 1e-12);
    EXPECT_NEAR(solid.distance(solid.nearest(point)), 0.0, 1e-12);
  }
}

TEST(SolidDistance, StopsAtTheLimit) {
  const Solid solid(samples::box({2, 2, 2}, 3));
  EXPECT_EQ(solid.distance({5.0, 0.0, 0.0}, 0.5), 0.5);
  EXPECT_NEAR(solid.distance({1.25, 0.0, 0.0}, 0.5), 0.25, 1e-15);
}

TEST(Solid, LidsOverHolesBoundTheInsideButAreNoSurfaceToMeasureFrom) {
  TriMesh mesh = samples::box({2, 2, 2}, 1);
  std::erase_if(mesh.triangles, [&](const auto& triangle) {
    return std::all_of(triangle.begin(), triangle.end(),
                       [&](int vertex) { return mesh.positions(vertex, 0) > 0.0; });
  });
  const Solid solid(mesh);
  EXPECT_TRUE(solid.contains({0.9, 0.0, 0.0}));
  EXPECT_NEAR(solid.distance({0.9, 0.0, 0.0}), 1.0, 1e-12);
  EXPECT_TRUE(solid.crosses({0.9, 0.1, 0.2}, {2.0, 0.1, 0.2}));
}

TEST(SolidCrosses, OnlyWhenTheSegmentMeetsTheSurfaceBetweenItsEnds) {
  const Solid solid(samples::box({2, 2, 2}, 3));
  EXPECT_FALSE(solid.crosses({0, 0, 0}, {0.9, 0.1, 0.2}));
  EXPECT_TRUE(solid.crosses({0, 0, 0}, {1.1, 0.1, 0.2}));
  EXPECT_TRUE(solid.crosses({-2, 0, 0}, {2, 0.1, 0.2}));
  EXPECT_FALSE(solid.crosses({2, 0, 0}, {3, 0, 0}));
  EXPECT_FALSE(solid.crosses({0, 0, 0}, {0, 0, 0}));
}

TEST(SolidCrosses, LooksAwayFromEndsThatLieOnTheSurfaceHoweverShortTheSegment) {
  const TriMesh& mesh = fine_sphere();
  const Solid solid(mesh);
  for (int vertex = 0; vertex < mesh.vertex_count(); vertex += 17) {
    const Vector3d at = mesh.positions.row(vertex);
    for (const double length : {1e-7, 1e-4, 0.3}) {
      EXPECT_FALSE(solid.crosses(at, (1.0 - length) * at)) << vertex << ' ' << length;
      EXPECT_FALSE(solid.crosses((1.0 + length) * at, at)) << vertex << ' ' << length;
      EXPECT_TRUE(solid.crosses((1.0 + length) * at, (1.0 - length) * at)) << vertex << ' ' << length;
    }
    EXPECT_TRUE(solid.crosses(at, -1.1 * at));
  }
}

TEST(SolidCrossings, CountUpToTheWindingNumberAndBackToNothing) {
  const TriMesh mesh = joined(fine_sphere(), moved(fine_sphere(), 0.5, Vector3d(0.1, 0.0, 0.0)));
  const Solid solid(mesh);
  std::vector<Crossing> found;
  solid.crossings({-3.0, 0.012, 0.034}, {3.0, 0.012, 0.034}, found);
  ASSERT_EQ(found.size(), 4u);
  const std::vector<int> changes = {1, 1, -1, -1};
  const std::vector<int> components = {0, 1, 1, 0};
  const std::vector<double> places = {-1.0, -0.4, 0.6, 1.0};
  for (int k = 0; k < 4; ++k) {
    EXPECT_EQ(found[k].change, changes[k]);
    EXPECT_EQ(found[k].component, components[k]);
    EXPECT_NEAR(-3.0 + 6.0 * found[k].share, places[k], 0.01);
    ASSERT_GE(found[k].triangle, 0);
    EXPECT_EQ(found[k].triangle < static_cast<int>(fine_sphere().triangles.size()), components[k] == 0);
  }
}

TEST(Solid, AnswersTheSameFromSeveralThreads) {
  const Solid solid(without_triangles(fine_torus(), 0.1));
  const std::vector<Vector3d> points = random_points(bounds(fine_torus()), 2000);
  const auto ask = [&](std::vector<double>& answers) {
    for (const Vector3d& point : points) {
      answers.push_back(solid.contains(point) ? solid.distance(point) : -solid.distance(point));
    }
  };
  std::vector<double> here, there;
  std::thread other([&] { ask(there); });
  ask(here);
  other.join();
  EXPECT_EQ(here, there);
}

TEST(Solid, OfNoTrianglesIsEmptySpace) {
  const Solid solid((TriMesh()));
  EXPECT_FALSE(solid.closed());
  EXPECT_FALSE(solid.contains({0, 0, 0}));
  EXPECT_EQ(solid.distance({1, 2, 3}), std::numeric_limits<double>::infinity());
  EXPECT_EQ(solid.nearest({1, 2, 3}), Vector3d(1, 2, 3));
  EXPECT_FALSE(solid.crosses({0, 0, 0}, {1, 1, 1}));
}

TEST(Solid, LeavesOutWhatIsNotFiniteAndWhatHasNoArea) {
  TriMesh mesh = fine_sphere();
  const int first = mesh.vertex_count();
  mesh.positions.conservativeResize(first + 1, 3);
  mesh.positions.bottomRows(1).setConstant(std::numeric_limits<double>::infinity());
  mesh.triangles.push_back({0, 1, first});
  mesh.triangles.push_back({2, 2, 2});
  EXPECT_EQ(wrong_verdicts({mesh.positions, {mesh.triangles.begin(), mesh.triangles.end() - 2}}, sphere_depth,
                           0.002),
            0);
  const Solid solid(mesh);
  EXPECT_TRUE(solid.contains({0.3, 0.2, 0.1}));
  EXPECT_FALSE(solid.contains({0.9, 0.9, 0.1}));
  EXPECT_NEAR(solid.distance({0.0, 0.0, 0.0}), 1.0, 0.01);
}

TEST(Solid, RefusesATriangleThatNamesNoVertex) {
  TriMesh mesh = samples::box({1, 1, 1}, 1);
  mesh.triangles[3][1] = 8;
  try {
    Solid solid(mesh);
    FAIL() << "expected std::invalid_argument";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "Solid: triangle 3 names vertex 8; expected 0 to 7");
  }
}

}  // namespace
}  // namespace sinew
