#pragma once

#include <random>
#include <vector>

#include "pipeline/mesh.h"

namespace sinew {

/// Ways in which surfaces arrive broken, each with a fixed seed.

inline TriMesh without_triangles(const TriMesh& mesh, double share) {
  std::mt19937 random(7);
  std::bernoulli_distribution removed(share);
  TriMesh damaged{mesh.positions, {}};
  for (const auto& triangle : mesh.triangles) {
    if (!removed(random)) damaged.triangles.push_back(triangle);
  }
  return damaged;
}

inline TriMesh with_flipped_triangles(TriMesh mesh, double share) {
  std::mt19937 random(11);
  std::bernoulli_distribution flipped(share);
  for (auto& triangle : mesh.triangles) {
    if (flipped(random)) std::swap(triangle[0], triangle[1]);
  }
  return mesh;
}

inline TriMesh joined(const TriMesh& a, const TriMesh& b) {
  TriMesh both = a;
  both.positions.conservativeResize(a.vertex_count() + b.vertex_count(), 3);
  both.positions.bottomRows(b.vertex_count()) = b.positions;
  for (auto triangle : b.triangles) {
    for (int& vertex : triangle) vertex += a.vertex_count();
    both.triangles.push_back(triangle);
  }
  return both;
}

inline TriMesh moved(TriMesh mesh, double scale, const Eigen::Vector3d& by) {
  mesh.positions = (scale * mesh.positions).rowwise() + by.transpose();
  return mesh;
}

/// Points spread evenly over a box.
inline std::vector<Eigen::Vector3d> random_points(const BoundingBox& box, int count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < count; ++k) {
    const Eigen::Vector3d shares(share(random), share(random), share(random));
    points.push_back(box.low + (box.high - box.low).cwiseProduct(shares));
  }
  return points;
}

}  // namespace sinew
