#include "pipeline/hole_lids.h"

#include <algorithm>
#include <cstdint>
#include <span>

namespace sinew {
namespace {

/// A directed edge that a lid has to use: the surface uses it once too often the other way round.
struct RimEdge {
  int from = 0;
  int to = 0;
};

/// Edges used more often in one direction than in the other, reversed, each as often as it lacks a
/// partner, by ascending `from`. At every vertex as many arrive as leave.
std::vector<RimEdge> rim_edges(const TriMesh& mesh) {
  // Low vertex, high vertex and direction in one number, so that sorting brings uses of an edge together.
  std::vector<std::uint64_t> uses;
  uses.reserve(3 * mesh.triangles.size());
  for (const auto& triangle : mesh.triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto from = static_cast<std::uint64_t>(triangle[corner]);
      const auto to = static_cast<std::uint64_t>(triangle[(corner + 1) % 3]);
      if (from == to) continue;
      uses.push_back(std::min(from, to) << 33 | std::max(from, to) << 1 | (from < to ? 1u : 0u));
    }
  }
  std::sort(uses.begin(), uses.end());
  std::vector<RimEdge> rim;
  for (std::size_t first = 0, last = 0; first < uses.size(); first = last) {
    int surplus = 0;  // uses from the low to the high vertex, less those the other way
    for (last = first; last < uses.size() && uses[last] >> 1 == uses[first] >> 1; ++last) {
      surplus += (uses[last] & 1u) ? 1 : -1;
    }
    const int low = static_cast<int>(uses[first] >> 33);
    const int high = static_cast<int>(uses[first] >> 1 & 0xffffffffu);
    for (; surplus > 0; --surplus) rim.push_back({high, low});
    for (; surplus < 0; ++surplus) rim.push_back({low, high});
  }
  std::stable_sort(rim.begin(), rim.end(),
                   [](const RimEdge& a, const RimEdge& b) { return a.from < b.from; });
  return rim;
}

void close_loop(const TriMesh& mesh, std::span<const int> loop, HoleLids& lids) {
  if (loop.size() < 3) return;  // there and back: nothing between
  if (loop.size() == 3) {
    lids.triangles.push_back({loop[0], loop[1], loop[2]});
    return;
  }
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double length = 0.0;
  for (std::size_t k = 0; k < loop.size(); ++k) {
    const Eigen::Vector3d from = mesh.positions.row(loop[k]);
    const Eigen::Vector3d to = mesh.positions.row(loop[(k + 1) % loop.size()]);
    sum += (to - from).norm() * (from + to) / 2.0;
    length += (to - from).norm();
  }
  const int middle = mesh.vertex_count() + static_cast<int>(lids.middles.size());
  lids.middles.push_back(length > 0.0 ? Eigen::Vector3d(sum / length)
                                      : Eigen::Vector3d(mesh.positions.row(loop[0])));
  for (std::size_t k = 0; k < loop.size(); ++k) {
    lids.triangles.push_back({loop[k], loop[(k + 1) % loop.size()], middle});
  }
}

}  // namespace

HoleLids close_holes(const TriMesh& mesh) {
  const std::vector<RimEdge> rim = rim_edges(mesh);
  HoleLids lids;
  if (rim.empty()) return lids;

  std::vector<int> next_edge(mesh.vertex_count() + 1, 0);  // first edge not yet walked from each vertex
  for (const RimEdge& edge : rim) ++next_edge[edge.from + 1];
  for (int vertex = 0; vertex < mesh.vertex_count(); ++vertex) next_edge[vertex + 1] += next_edge[vertex];
  const std::vector<int> last_edge(next_edge.begin() + 1, next_edge.end());

  // Walk along the rim; whenever the walk meets itself, the part since then is a loop.
  std::vector<int> place_in_walk(mesh.vertex_count(), -1);
  std::vector<int> walk;
  for (const RimEdge& start : rim) {
    int vertex = start.from;
    while (next_edge[vertex] < last_edge[vertex]) {
      place_in_walk[vertex] = static_cast<int>(walk.size());
      walk.push_back(vertex);
      vertex = rim[next_edge[vertex]++].to;
      if (place_in_walk[vertex] < 0) continue;
      const std::size_t begin = place_in_walk[vertex];
      close_loop(mesh, std::span(walk).subspan(begin), lids);
      for (std::size_t k = begin; k < walk.size(); ++k) place_in_walk[walk[k]] = -1;
      walk.resize(begin);
    }
  }
  return lids;
}

}  // namespace sinew
