#include "samples/shapes.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

namespace sinew::samples {
namespace {

using Eigen::Vector3d;

TriMesh make_mesh(const std::vector<Vector3d>& points, std::vector<std::array<int, 3>> triangles) {
  TriMesh mesh;
  mesh.positions.resize(static_cast<Eigen::Index>(points.size()), 3);
  for (std::size_t k = 0; k < points.size(); ++k) {
    mesh.positions.row(static_cast<Eigen::Index>(k)) = points[k].transpose();
  }
  mesh.triangles = std::move(triangles);
  return mesh;
}

/// Two triangles between step k and k + 1 of two rings of `count` vertices, for every k.
void join_rings(int lower, int upper, int count, std::vector<std::array<int, 3>>& triangles) {
  for (int k = 0; k < count; ++k) {
    const int next = (k + 1) % count;
    triangles.push_back({lower + k, lower + next, upper + next});
    triangles.push_back({lower + k, upper + next, upper + k});
  }
}

/// A sweep in progress: rings of vertices, each joined to the one before.
struct Sweep {
  int around = 0;
  std::vector<Vector3d> points;
  std::vector<std::array<int, 3>> triangles;

  void start(const Vector3d& tip) { points.push_back(tip); }
  void add_ring(const std::vector<Vector3d>& ring) {
    const int lower = static_cast<int>(points.size()) - around;
    const int upper = static_cast<int>(points.size());
    points.insert(points.end(), ring.begin(), ring.end());
    if (upper > 1) {
      join_rings(lower, upper, around, triangles);
      return;
    }
    for (int k = 0; k < around; ++k) triangles.push_back({0, upper + (k + 1) % around, upper + k});
  }
  void finish(const Vector3d& tip) {
    const int ring = static_cast<int>(points.size()) - around;
    const int top = static_cast<int>(points.size());
    points.push_back(tip);
    for (int k = 0; k < around; ++k) triangles.push_back({ring + k, ring + (k + 1) % around, top});
  }
};

/// Unit vectors round `along`, counter-clockwise seen from where it points.
std::vector<Vector3d> circle(const Vector3d& along, int around) {
  const Vector3d u = along.unitOrthogonal();
  const Vector3d v = along.cross(u);
  std::vector<Vector3d> directions;
  for (int k = 0; k < around; ++k) {
    const double turn = 2.0 * std::numbers::pi * k / around;
    directions.push_back(std::cos(turn) * u + std::sin(turn) * v);
  }
  return directions;
}

/// Moves each point along `along` onto the plane through `center` with `normal`.
std::vector<Vector3d> slide_to_plane(const std::vector<Vector3d>& ring, const Vector3d& along,
                                     const Vector3d& center, const Vector3d& normal) {
  std::vector<Vector3d> moved;
  for (const Vector3d& point : ring) {
    moved.push_back(point + (center - point).dot(normal) / along.dot(normal) * along);
  }
  return moved;
}

}  // namespace

TriMesh box(const Vector3d& size, int segments) {
  std::vector<Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
  std::map<std::array<int, 3>, int> vertex_at;  // grid place to vertex: faces share their edges
  const auto vertex = [&](const std::array<int, 3>& place) {
    const auto [entry, added] = vertex_at.try_emplace(place, static_cast<int>(points.size()));
    if (added) points.push_back(Vector3d(place[0], place[1], place[2]) / segments - Vector3d::Constant(0.5));
    return entry->second;
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {0, segments}) {
      for (int u = 0; u < segments; ++u) {
        for (int v = 0; v < segments; ++v) {
          std::array<int, 4> corners = {};
          for (int k = 0; k < 4; ++k) {
            std::array<int, 3> place = {};
            place[axis] = side;
            place[(axis + 1) % 3] = u + (k == 1 || k == 2);
            place[(axis + 2) % 3] = v + (k >= 2);
            corners[k] = vertex(place);
          }
          if (side == 0) std::swap(corners[1], corners[3]);
          triangles.push_back({corners[0], corners[1], corners[2]});
          triangles.push_back({corners[0], corners[2], corners[3]});
        }
      }
    }
  }
  for (Vector3d& point : points) point = point.cwiseProduct(size);
  return make_mesh(points, std::move(triangles));
}

TriMesh sphere(double radius, int subdivisions) {
  const double g = std::numbers::phi;
  std::vector<Vector3d> points = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                                  {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  std::vector<std::array<int, 3>> triangles = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                               {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                               {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                               {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int step = 0; step < subdivisions; ++step) {
    std::map<std::pair<int, int>, int> middle_of;
    const auto middle = [&](int a, int b) {
      const auto [entry, added] = middle_of.try_emplace(std::minmax(a, b), static_cast<int>(points.size()));
      if (added) points.push_back((points[a].normalized() + points[b].normalized()) / 2.0);
      return entry->second;
    };
    std::vector<std::array<int, 3>> finer;
    for (const auto& [a, b, c] : triangles) {
      const int ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    triangles = std::move(finer);
  }
  for (Vector3d& point : points) point = radius * point.normalized();
  return make_mesh(points, std::move(triangles));
}

TriMesh torus(double ring_radius, double tube_radius, int ring_segments, int tube_segments) {
  std::vector<Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
  for (int ring = 0; ring < ring_segments; ++ring) {
    const double turn = 2.0 * std::numbers::pi * ring / ring_segments;
    const Vector3d out(std::cos(turn), 0.0, std::sin(turn));
    for (int k = 0; k < tube_segments; ++k) {
      const double roll = 2.0 * std::numbers::pi * k / tube_segments;
      points.push_back((ring_radius + tube_radius * std::cos(roll)) * out +
                       tube_radius * std::sin(roll) * Vector3d::UnitY());
    }
    const int next = (ring + 1) % ring_segments;
    join_rings(ring * tube_segments, next * tube_segments, tube_segments, triangles);
  }
  return make_mesh(points, std::move(triangles));
}

TriMesh tube(const std::vector<Vector3d>& axis, double radius, int around) {
  const double step = 2.0 * std::numbers::pi * radius / around;
  const int cap_rings = std::max(2, static_cast<int>(std::lround(around / 4.0)));
  const auto direction = [&](std::size_t piece) {
    return (axis[piece + 1] - axis[piece]).normalized().eval();
  };
  const std::size_t pieces = axis.size() - 1;

  Sweep sweep{around, {}, {}};
  const Vector3d first = direction(0);
  std::vector<Vector3d> ring = circle(first, around);
  sweep.start(axis.front() - radius * first);
  for (int cap = 1; cap <= cap_rings; ++cap) {  // the last of these is the tube's first ring
    const double rise = std::numbers::pi / 2.0 * cap / cap_rings;
    std::vector<Vector3d> scaled;
    for (const Vector3d& out : ring) {
      scaled.push_back(axis.front() + radius * (std::sin(rise) * out - std::cos(rise) * first));
    }
    sweep.add_ring(scaled);
    if (cap == cap_rings) ring = scaled;
  }
  for (std::size_t piece = 0; piece < pieces; ++piece) {
    const Vector3d along = direction(piece);
    const Vector3d after = piece + 1 < pieces ? direction(piece + 1) : along;
    const std::vector<Vector3d> end =
        slide_to_plane(ring, along, axis[piece + 1], (along + after).normalized());
    const int steps =
        std::max(1, static_cast<int>(std::lround((axis[piece + 1] - axis[piece]).norm() / step)));
    for (int k = 1; k <= steps; ++k) {
      std::vector<Vector3d> between;
      for (int point = 0; point < around; ++point) {
        between.push_back(ring[point] + static_cast<double>(k) / steps * (end[point] - ring[point]));
      }
      sweep.add_ring(between);
    }
    ring = end;
  }
  const Vector3d last = direction(pieces - 1);
  for (int cap = cap_rings - 1; cap >= 1; --cap) {
    const double rise = std::numbers::pi / 2.0 * cap / cap_rings;
    std::vector<Vector3d> scaled;
    for (const Vector3d& point : ring) {
      scaled.push_back(axis.back() + std::sin(rise) * (point - axis.back()) + radius * std::cos(rise) * last);
    }
    sweep.add_ring(scaled);
  }
  sweep.finish(axis.back() + radius * last);
  return make_mesh(sweep.points, std::move(sweep.triangles));
}

TriMesh arm(double length, double radius, double bend, int around) {
  const Vector3d elbow(length / 2.0, 0.0, 0.0);
  const Vector3d wrist = elbow + length / 2.0 * Vector3d(std::cos(bend), std::sin(bend), 0.0);
  return tube({Vector3d::Zero(), elbow, wrist}, radius, around);
}

TriMesh two_legs(double length, double radius, double gap, int around) {
  const double x = radius + gap / 2.0;
  return tube({{-x, -length, 0.0}, {-x, 0.0, 0.0}, {x, 0.0, 0.0}, {x, -length, 0.0}}, radius, around);
}

}  // namespace sinew::samples
