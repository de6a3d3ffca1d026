#include "pipeline/mesh.h"

#include <Eigen/Geometry>

namespace sinew {

BoundingBox bounds(const TriMesh& mesh) {
  if (mesh.triangles.empty()) return {};
  BoundingBox box;
  box.low = box.high = mesh.positions.row(mesh.triangles.front()[0]).transpose();
  for (const auto& triangle : mesh.triangles) {
    for (const int vertex : triangle) {
      box.low = box.low.cwiseMin(mesh.positions.row(vertex).transpose());
      box.high = box.high.cwiseMax(mesh.positions.row(vertex).transpose());
    }
  }
  return box;
}

double enclosed_volume(const TriMesh& mesh, const Eigen::Ref<const Field3>& positions) {
  if (mesh.triangles.empty()) return 0.0;
  // Relative to a point of the surface, so that a body far from the origin loses no digits.
  const Eigen::Vector3d origin = positions.row(mesh.triangles.front()[0]).transpose();
  double six_volumes = 0.0;
  for (const auto& triangle : mesh.triangles) {
    const Eigen::Vector3d a = positions.row(triangle[0]).transpose() - origin;
    const Eigen::Vector3d b = positions.row(triangle[1]).transpose() - origin;
    const Eigen::Vector3d c = positions.row(triangle[2]).transpose() - origin;
    six_volumes += a.dot(b.cross(c));
  }
  return six_volumes / 6.0;
}

double mean_edge_length(const TriMesh& mesh) {
  if (mesh.triangles.empty()) return 0.0;
  double sum = 0.0;
  for (const auto& triangle : mesh.triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      sum += (mesh.positions.row(triangle[corner]) - mesh.positions.row(triangle[(corner + 1) % 3])).norm();
    }
  }
  return sum / (3.0 * static_cast<double>(mesh.triangles.size()));
}

}  // namespace sinew
