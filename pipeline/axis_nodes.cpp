#include "pipeline/axis_nodes.h"

#include <algorithm>
#include <cmath>

namespace sinew {
namespace {

/// Fewer interior nodes than this in a bone's cylinder do not turn a limb: with less the tip of a
/// bent finger ended up a finger's width away.
constexpr int kFewNodes = 20;

/// Nodes on the axis of a thin limb, unless the lattice is finer still.
constexpr int kAxisNodes = 20;

/// Nodes up to this many R from the axis are linked to it: the limb's own surface and little else.
constexpr double kLinkReach = 1.5;

struct AxisChain {
  int segment = 0;
  std::vector<int> nodes;      ///< of the volume graph, from the segment's start to its end
  std::vector<double> places;  ///< share of the segment, alongside nodes
};

bool in_cylinder(const BoneSegment& segment, const Foot& foot) {
  return foot.along >= segment.cylinder_begin && foot.along <= segment.cylinder_end &&
         foot.distance <= segment.cylinder_radius(foot.along);
}

/// The longest stretch of the segment, in length, without one of `places` (shares of it).
double longest_gap(std::vector<double> places, double length) {
  places.push_back(0.0);
  places.push_back(1.0);
  std::sort(places.begin(), places.end());
  double gap = 0.0;
  for (std::size_t k = 1; k < places.size(); ++k) gap = std::max(gap, places[k] - places[k - 1]);
  return gap * length;
}

bool is_thin(const BoneSegment& segment, const VolumeGraph& volume, const BindingOptions& options) {
  int in_reach = 0;
  std::vector<double> core_places;
  for (int node = volume.surface_count; node < volume.node_count(); ++node) {
    const Foot foot = foot_on(segment.axis, volume.rest_positions.row(node).transpose());
    if (foot.along < 0.0 || foot.along > 1.0) continue;
    in_reach += in_cylinder(segment, foot) ? 1 : 0;
    if (foot.distance <= options.core_share * segment.thickness.at(foot.along)) core_places.push_back(foot.along);
  }
  if (in_reach < kFewNodes) return true;
  return options.cores && longest_gap(std::move(core_places), segment.length) > segment.thickness.mean();
}

AxisChain place_nodes(const BoneSegment& segment, int index, int first_node, double spacing,
                      std::vector<Eigen::Vector3d>& positions) {
  AxisChain chain{index, {}, {}};
  const int wanted = spacing > 0.0 ? static_cast<int>(std::ceil(segment.length / spacing)) : 0;
  const int count = std::max(kAxisNodes, wanted);
  for (int k = 0; k < count; ++k) {
    const double along = (k + 0.5) / count;
    if (segment.thickness.at(along) <= 0.0) continue;  // outside the body
    chain.nodes.push_back(first_node + static_cast<int>(positions.size()));
    chain.places.push_back(along);
    positions.push_back(point_on(segment.axis, along));
  }
  return chain;
}

/// Links between the chains' ends wherever one segment begins where another ends or begins.
void link_chains(const BoneRegions& regions, const std::vector<AxisChain>& chains, std::vector<Edge>& edges) {
  const auto start_joint = [&](const AxisChain& chain) {
    const BoneSegment& segment = regions.segments[chain.segment];
    return segment.helper ? -1 : regions.bones[segment.bone].joint;
  };
  for (const AxisChain& chain : chains) {
    for (std::size_t k = 1; k < chain.nodes.size(); ++k) edges.push_back({chain.nodes[k - 1], chain.nodes[k]});
    const int end_joint = regions.segments[chain.segment].end_joint;
    for (const AxisChain& next : chains) {
      if (&next == &chain || chain.nodes.empty() || next.nodes.empty()) continue;
      if (end_joint >= 0 && start_joint(next) == end_joint) {
        edges.push_back({chain.nodes.back(), next.nodes.front()});
      } else if (&chain < &next && start_joint(chain) >= 0 && start_joint(chain) == start_joint(next)) {
        edges.push_back({chain.nodes.front(), next.nodes.front()});
      }
    }
  }
}

/// The two nodes of the chain round a place; twice the same at its ends.
std::pair<int, int> neighbors_in(const AxisChain& chain, double along) {
  const auto above = std::lower_bound(chain.places.begin(), chain.places.end(), along);
  const auto index = static_cast<int>(above - chain.places.begin());
  const int last = static_cast<int>(chain.nodes.size()) - 1;
  return {chain.nodes[std::clamp(index - 1, 0, last)], chain.nodes[std::clamp(index, 0, last)]};
}

/// Ties each node near the axis to the two nodes of the chain beside its foot. Going by what is near
/// rather than by the nearest few ties the limb evenly all round.
void link_to_body(const Solid& solid, const BoneSegment& segment, const AxisChain& chain,
                  const std::vector<Eigen::Vector3d>& added, const VolumeGraph& volume, std::vector<Edge>& edges) {
  if (chain.nodes.empty()) return;
  const double mean = segment.thickness.mean();
  const int body_nodes = volume.node_count();
  for (int node = 0; node < body_nodes; ++node) {
    const Eigen::Vector3d position = volume.rest_positions.row(node).transpose();
    const Foot foot = clamped_foot_on(segment.axis, position);
    if (foot.distance > kLinkReach * std::max(mean, segment.thickness.at(foot.along))) continue;
    const auto [below, above] = neighbors_in(chain, foot.along);
    // At the chain's ends both are the same node; make_graph() keeps such a link once.
    for (const int axis_node : {below, above}) {
      if (!solid.crosses(position, added[axis_node - body_nodes])) edges.push_back({node, axis_node});
    }
  }
}

void append(const std::vector<Eigen::Vector3d>& positions, std::vector<Edge> edges, VolumeGraph& volume) {
  const int before = volume.node_count();
  const int after = before + static_cast<int>(positions.size());
  for (int node = 0; node < before; ++node) {
    for (int k = volume.graph.offsets[node]; k < volume.graph.offsets[node + 1]; ++k) {
      const int other = volume.graph.neighbors[k];
      if (node < other) edges.push_back({node, other, volume.graph.weights[k]});
    }
  }
  volume.graph = make_graph(after, edges);
  volume.rest_positions.conservativeResize(after, Eigen::NoChange);
  for (int k = 0; k < after - before; ++k) volume.rest_positions.row(before + k) = positions[k].transpose();
}

}  // namespace

std::vector<bool> thin_segments(const BoneRegions& regions, const VolumeGraph& volume,
                                const BindingOptions& options) {
  std::vector<bool> thin;
  for (const BoneSegment& segment : regions.segments) {
    thin.push_back(volume.interior == Interior::none || is_thin(segment, volume, options));
  }
  return thin;
}

void add_axis_nodes(const Solid& solid, const BoneRegions& regions, const std::vector<bool>& wanted,
                    VolumeGraph& volume) {
  std::vector<Eigen::Vector3d> positions;
  std::vector<AxisChain> chains;
  for (std::size_t k = 0; k < regions.segments.size(); ++k) {
    if (!wanted[k]) continue;
    chains.push_back(place_nodes(regions.segments[k], static_cast<int>(k), volume.node_count(), volume.spacing,
                                 positions));
  }
  if (positions.empty()) return;
  std::vector<Edge> edges;
  link_chains(regions, chains, edges);
  for (const AxisChain& chain : chains) {
    link_to_body(solid, regions.segments[chain.segment], chain, positions, volume, edges);
  }
  append(positions, std::move(edges), volume);
}

}  // namespace sinew
