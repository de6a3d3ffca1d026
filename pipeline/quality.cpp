#include "pipeline/quality.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "pipeline/bone_regions.h"
#include "pipeline/solid.h"

namespace sinew {
namespace {

/// A joint's piece of body reaches this many local thicknesses from it.
constexpr double kPatchReach = 3.0;

/// Edges shorter than this share of the mean one are left out of stretch: the ratio of two
/// lengths near nothing says nothing about the shape.
constexpr double kShortEdge = 0.1;

/// Normals of a fold's two triangles are further apart than 120 degrees.
constexpr double kFoldCosine = -0.5;

Eigen::Vector3d point(const Field3& positions, int node) { return positions.row(node).transpose(); }

Eigen::Vector3d normal(const Field3& positions, const std::array<int, 3>& triangle) {
  const Eigen::Vector3d a = point(positions, triangle[0]);
  return (point(positions, triangle[1]) - a).cross(point(positions, triangle[2]) - a);
}

bool is_folded(const Field3& positions, const TriMesh& mesh, const std::array<int, 2>& triangles) {
  if (triangles[0] < 0 || triangles[1] < 0) return false;
  const Eigen::Vector3d first = normal(positions, mesh.triangles[triangles[0]]);
  const Eigen::Vector3d second = normal(positions, mesh.triangles[triangles[1]]);
  return first.dot(second) < kFoldCosine * first.norm() * second.norm();
}

double six_volumes(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  return a.dot(b.cross(c));
}

double volume_of(const SurfacePatch& patch, const Field3& positions) {
  if (patch.triangles.empty()) return 0.0;
  const Eigen::Vector3d origin = point(positions, patch.triangles.front()[0]);
  double sum = 0.0;
  for (const auto& triangle : patch.triangles) {
    sum += six_volumes(point(positions, triangle[0]) - origin, point(positions, triangle[1]) - origin,
                       point(positions, triangle[2]) - origin);
  }
  for (const auto& rim : patch.rims) {
    Eigen::Vector3d middle = Eigen::Vector3d::Zero();
    for (const auto& edge : rim) middle += point(positions, edge[0]);
    middle /= static_cast<double>(rim.size());
    for (const auto& edge : rim) {
      sum += six_volumes(middle - origin, point(positions, edge[1]) - origin, point(positions, edge[0]) - origin);
    }
  }
  return sum / 6.0;
}

/// Smallest member's label for each vertex that `triangles` join.
class Groups {
 public:
  explicit Groups(int count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  int find(int item) {
    while (parent_[item] != item) item = parent_[item] = parent_[parent_[item]];
    return item;
  }
  void join(int a, int b) {
    const int first = find(a);
    const int second = find(b);
    parent_[std::max(first, second)] = std::min(first, second);
  }

 private:
  std::vector<int> parent_;
};

/// Keeps the connected piece with the triangle nearest to `center`.
std::vector<std::array<int, 3>> connected_piece(const TriMesh& mesh, const std::vector<std::array<int, 3>>& triangles,
                                                const Eigen::Vector3d& center) {
  Groups groups(mesh.vertex_count());
  double nearest = -1.0;
  int wanted = -1;
  for (const auto& triangle : triangles) {
    groups.join(triangle[0], triangle[1]);
    groups.join(triangle[1], triangle[2]);
    const double distance = (point(mesh.positions, triangle[0]) - center).squaredNorm();
    if (wanted >= 0 && distance >= nearest) continue;
    nearest = distance;
    wanted = triangle[0];
  }
  std::vector<std::array<int, 3>> piece;
  for (const auto& triangle : triangles) {
    if (groups.find(triangle[0]) == groups.find(wanted)) piece.push_back(triangle);
  }
  return piece;
}

std::vector<std::vector<std::array<int, 2>>> rims_of(const std::vector<std::array<int, 3>>& triangles,
                                                     int vertex_count) {
  std::map<std::array<int, 2>, int> directed;
  for (const auto& triangle : triangles) {
    for (int corner = 0; corner < 3; ++corner) ++directed[{triangle[corner], triangle[(corner + 1) % 3]}];
  }
  Groups groups(vertex_count);
  std::vector<std::array<int, 2>> open;
  for (const auto& [edge, count] : directed) {
    if (directed.count({edge[1], edge[0]}) != 0) continue;
    open.push_back(edge);
    groups.join(edge[0], edge[1]);
  }
  std::map<int, std::vector<std::array<int, 2>>> by_rim;
  for (const auto& edge : open) by_rim[groups.find(edge[0])].push_back(edge);
  std::vector<std::vector<std::array<int, 2>>> rims;
  for (auto& [first, rim] : by_rim) rims.push_back(std::move(rim));
  return rims;
}

SurfacePatch patch_round(const TriMesh& mesh, const Eigen::Vector3d& center, double radius) {
  std::vector<std::array<int, 3>> near;
  for (const auto& triangle : mesh.triangles) {
    const bool within = std::all_of(triangle.begin(), triangle.end(), [&](int vertex) {
      return (point(mesh.positions, vertex) - center).norm() <= radius;
    });
    if (within) near.push_back(triangle);
  }
  SurfacePatch patch;
  if (near.empty()) return patch;
  patch.triangles = connected_piece(mesh, near, center);
  patch.rims = rims_of(patch.triangles, mesh.vertex_count());
  return patch;
}

/// Weights of the nodes nearest to `target` that sum to one and average to it.
std::vector<std::pair<int, double>> carriers_of(const VolumeGraph& volume, const Eigen::Vector3d& target) {
  constexpr int wanted = 12;
  std::vector<std::pair<double, int>> nodes;
  for (int node = 0; node < volume.node_count(); ++node) {
    nodes.emplace_back((point(volume.rest_positions, node) - target).squaredNorm(), node);
  }
  const int count = std::min<int>(wanted, static_cast<int>(nodes.size()));
  std::partial_sort(nodes.begin(), nodes.begin() + count, nodes.end());
  // Nearer nodes carry more: the least sum of squared weights times squared distances.
  const double reach = std::sqrt(std::max(nodes[count - 1].first, 1e-300));
  Eigen::Matrix<double, 4, Eigen::Dynamic> A(4, count);
  Eigen::VectorXd nearness(count);
  for (int k = 0; k < count; ++k) {
    const Eigen::Vector3d arm = (point(volume.rest_positions, nodes[k].second) - target) / reach;
    constexpr double softness = 1e-6;
    nearness[k] = 1.0 / (arm.squaredNorm() + softness);
    A.col(k) << 1.0, arm;
  }
  const Eigen::Matrix4d normal_matrix = A * nearness.asDiagonal() * A.transpose();
  const Eigen::Vector4d multipliers = normal_matrix.ldlt().solve(Eigen::Vector4d(1, 0, 0, 0));
  const Eigen::VectorXd weights = nearness.cwiseProduct(A.transpose() * multipliers);
  std::vector<std::pair<int, double>> carriers;
  for (int k = 0; k < count; ++k) carriers.emplace_back(nodes[k].second, weights[k]);
  return carriers;
}

bool segment_hits(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const std::array<Eigen::Vector3d, 3>& t) {
  const Eigen::Vector3d direction = to - from;
  const double volume = six_volumes(t[1] - t[0], t[2] - t[0], direction);
  if (volume == 0.0) return false;
  const double place = six_volumes(t[1] - t[0], t[2] - t[0], t[0] - from) / volume;
  if (place <= 0.0 || place >= 1.0) return false;
  const Eigen::Vector3d hit = from + place * direction;
  const Eigen::Vector3d normal = (t[1] - t[0]).cross(t[2] - t[0]);
  for (int corner = 0; corner < 3; ++corner) {
    const Eigen::Vector3d& a = t[corner];
    if (normal.dot((t[(corner + 1) % 3] - a).cross(hit - a)) <= 0.0) return false;
  }
  return true;
}

bool triangles_cut(const std::array<Eigen::Vector3d, 3>& a, const std::array<Eigen::Vector3d, 3>& b) {
  for (int corner = 0; corner < 3; ++corner) {
    if (segment_hits(a[corner], a[(corner + 1) % 3], b) || segment_hits(b[corner], b[(corner + 1) % 3], a)) return true;
  }
  return false;
}

bool share_a_vertex(const std::array<int, 3>& a, const std::array<int, 3>& b) {
  return std::any_of(a.begin(), a.end(),
                     [&](int vertex) { return std::find(b.begin(), b.end(), vertex) != b.end(); });
}

}  // namespace

QualityMeter::QualityMeter(const Rig& rig) : rig_(rig) {
  rest_volume_ = enclosed_volume(rig.mesh, rig.mesh.positions);
  find_edges();
  find_patches();
  find_axis_points();
}

void QualityMeter::find_edges() {
  std::map<std::pair<int, int>, std::size_t> known;
  for (int triangle = 0; triangle < static_cast<int>(rig_.mesh.triangles.size()); ++triangle) {
    const auto& corners = rig_.mesh.triangles[triangle];
    for (int corner = 0; corner < 3; ++corner) {
      const auto ends = std::minmax(corners[corner], corners[(corner + 1) % 3]);
      const auto [found, is_new] = known.try_emplace(ends, edges_.size());
      if (is_new) {
        const double length = (rig_.mesh.positions.row(ends.first) - rig_.mesh.positions.row(ends.second)).norm();
        edges_.push_back({ends.first, ends.second, {triangle, -1}, length, false});
      } else {
        edges_[found->second].triangles[1] = triangle;
      }
    }
  }
  for (SurfaceEdge& edge : edges_) edge.folded_at_rest = is_folded(rig_.mesh.positions, rig_.mesh, edge.triangles);
}

void QualityMeter::find_patches() {
  const Solid solid(rig_.mesh);
  for (const RigJoint& joint : rig_.skeleton.joints) {
    const double radius = solid.contains(joint.position) ? kPatchReach * solid.distance(joint.position) : 0.0;
    patches_.push_back(patch_round(rig_.mesh, joint.position, radius));
    patch_volumes_.push_back(volume_of(patches_.back(), rig_.mesh.positions));
  }
}

void QualityMeter::find_axis_points() {
  const Solid solid(rig_.mesh);
  constexpr int per_segment = 8;
  for (const BoneSegment& segment : bone_regions(solid, rig_.skeleton, {}).segments) {
    if (segment.helper || segment.end_joint < 0) continue;
    for (int k = 0; k < per_segment; ++k) {
      AxisPoint axis_point;
      axis_point.joint = rig_.binding.bones[segment.bone].joint;
      axis_point.end_joint = segment.end_joint;
      axis_point.along = (k + 0.5) / per_segment;
      axis_point.rest = point_on(segment.axis, axis_point.along);
      axis_point.thickness = segment.thickness.at(axis_point.along);
      if (axis_point.thickness <= 0.0) continue;
      axis_point.carriers = carriers_of(rig_.volume, axis_point.rest);
      axis_points_.push_back(std::move(axis_point));
    }
  }
}

double QualityMeter::volume_ratio(const Field3& positions) const {
  return enclosed_volume(rig_.mesh, positions.topRows(rig_.mesh.vertex_count())) / rest_volume_;
}

double QualityMeter::local_volume_ratio(int joint, const Field3& positions) const {
  return patch_volumes_[joint] == 0.0 ? 1.0 : volume_of(patches_[joint], positions) / patch_volumes_[joint];
}

EdgeStretch QualityMeter::edge_stretch(const Field3& positions) const {
  const double shortest = kShortEdge * mean_edge_length(rig_.mesh);
  std::vector<double> ratios;
  for (const SurfaceEdge& edge : edges_) {
    if (edge.rest_length <= shortest) continue;
    ratios.push_back((positions.row(edge.a) - positions.row(edge.b)).norm() / edge.rest_length);
  }
  if (ratios.empty()) return {};
  std::sort(ratios.begin(), ratios.end());
  const auto at = [&](double share) { return ratios[static_cast<std::size_t>(share * static_cast<double>(ratios.size() - 1))]; };
  return {at(0.01), at(0.99), ratios.front(), ratios.back()};
}

int QualityMeter::folded_edges(const Field3& positions) const {
  int count = 0;
  for (const SurfaceEdge& edge : edges_) {
    count += !edge.folded_at_rest && is_folded(positions, rig_.mesh, edge.triangles) ? 1 : 0;
  }
  return count;
}

double QualityMeter::bone_drift(const Pose& pose, const Field3& positions) const {
  double largest = 0.0;
  for (const AxisPoint& axis_point : axis_points_) {
    const Eigen::Vector3d& start = pose.positions[axis_point.joint];
    const Eigen::Vector3d rigid = start + axis_point.along * (pose.positions[axis_point.end_joint] - start);
    Eigen::Vector3d carried = Eigen::Vector3d::Zero();
    for (const auto& [node, weight] : axis_point.carriers) carried += weight * point(positions, node);
    largest = std::max(largest, (carried - rigid).norm() / axis_point.thickness);
  }
  return largest;
}

int QualityMeter::self_intersections(const Field3& positions) const {
  const auto& triangles = rig_.mesh.triangles;
  std::vector<Eigen::AlignedBox3d> boxes(triangles.size());
  for (std::size_t k = 0; k < triangles.size(); ++k) {
    for (const int vertex : triangles[k]) boxes[k].extend(point(positions, vertex));
  }
  // Sweep along x: only triangles whose x ranges overlap are compared.
  std::vector<int> order(triangles.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return boxes[a].min().x() < boxes[b].min().x(); });
  const auto corners = [&](int triangle) {
    return std::array<Eigen::Vector3d, 3>{point(positions, triangles[triangle][0]),
                                          point(positions, triangles[triangle][1]),
                                          point(positions, triangles[triangle][2])};
  };
  int count = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    for (std::size_t other = k + 1; other < order.size(); ++other) {
      if (boxes[order[other]].min().x() > boxes[order[k]].max().x()) break;
      if (!boxes[order[k]].intersects(boxes[order[other]])) continue;
      if (share_a_vertex(triangles[order[k]], triangles[order[other]])) continue;
      count += triangles_cut(corners(order[k]), corners(order[other])) ? 1 : 0;
    }
  }
  return count;
}

}  // namespace sinew
