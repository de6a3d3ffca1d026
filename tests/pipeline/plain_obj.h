#pragma once

#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "pipeline/mesh.h"

namespace sinew {

/// Vertices at the very same place become one, as they are when a mesh reaches the pipeline.
inline TriMesh weld(const std::vector<Eigen::Vector3d>& points, std::vector<std::array<int, 3>> triangles) {
  std::map<std::array<double, 3>, int> vertex_at;
  std::vector<int> vertex_of_point;
  for (const Eigen::Vector3d& p : points) {
    vertex_of_point.push_back(
        vertex_at.try_emplace({p.x(), p.y(), p.z()}, static_cast<int>(vertex_at.size())).first->second);
  }
  TriMesh mesh;
  mesh.positions.resize(static_cast<Eigen::Index>(vertex_at.size()), 3);
  for (std::size_t k = 0; k < points.size(); ++k)
    mesh.positions.row(vertex_of_point[k]) = points[k].transpose();
  for (auto& triangle : triangles) {
    for (int& corner : triangle) corner = vertex_of_point[corner];
  }
  mesh.triangles = std::move(triangles);
  return mesh;
}

/// Just enough of OBJ (v and f) and OFF for well-known files; empty when the file is not there.
inline TriMesh read_plain_mesh(const std::string& path) {
  std::ifstream file(path);
  const bool is_off = path.ends_with(".off");
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
  const auto add_fan = [&](const std::vector<int>& face) {
    for (std::size_t k = 2; k < face.size(); ++k) triangles.push_back({face[0], face[k - 1], face[k]});
  };
  std::string word;
  if (is_off) {
    std::size_t point_count = 0, face_count = 0, edge_count = 0;
    file >> word >> point_count >> face_count >> edge_count;
    points.resize(point_count);
    for (Eigen::Vector3d& p : points) file >> p.x() >> p.y() >> p.z();
    for (std::size_t f = 0, corners = 0; f < face_count && file >> corners; ++f) {
      std::vector<int> face(corners);
      for (int& corner : face) file >> corner;
      add_fan(face);
    }
    return weld(points, std::move(triangles));
  }
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    if (!(words >> word)) continue;
    if (word == "v") {
      Eigen::Vector3d p;
      words >> p.x() >> p.y() >> p.z();
      points.push_back(p);
    } else if (word == "f") {
      std::vector<int> face;
      while (words >> word) face.push_back(std::stoi(word) - 1);  // stops at the slash
      add_fan(face);
    }
  }
  return weld(points, std::move(triangles));
}

}  // namespace sinew
