#include "pipeline/free_system.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

namespace sinew {
namespace {

/// Where the nodes are, counted in layers of the lattice along each axis.
using Layers = Eigen::Matrix<int, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// A body-centred lattice has two layers to its constant. A surface vertex counts to the nearest ones.
Layers lattice_layers(const VolumeGraph& volume, const std::vector<int>& nodes) {
  const Eigen::RowVector3d origin = volume.rest_positions.row(volume.surface_count);
  Layers layers(nodes.size(), 3);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const Eigen::RowVector3d steps = 2.0 / volume.spacing * (volume.rest_positions.row(nodes[k]) - origin);
    layers.row(static_cast<Eigen::Index>(k)) = steps.array().round().cast<int>();
  }
  layers.rowwise() -= layers.colwise().minCoeff().eval();
  return layers;
}

/// Nodes in a node's own layer, on average: what lies between a node and its neighbors in the next layers.
double mean_layer(const Layers& layers, int axis) {
  std::vector<double> counts(static_cast<std::size_t>(layers.col(axis).maxCoeff()) + 1, 0.0);
  for (const int layer : layers.col(axis)) counts[layer] += 1.0;
  return std::inner_product(counts.begin(), counts.end(), counts.begin(), 0.0) /
         static_cast<double>(layers.rows());
}

struct Axes {
  int across = 0;  ///< the layers
  int between = 0;
  int along = 0;  ///< the lines
};

/// Thin layers, and in them long lines.
Axes order_axes(const Layers& layers) {
  const std::array<double, 3> means = {mean_layer(layers, 0), mean_layer(layers, 1), mean_layer(layers, 2)};
  Axes axes;
  axes.across = static_cast<int>(std::min_element(means.begin(), means.end()) - means.begin());
  axes.between = (axes.across + 1) % 3;
  axes.along = (axes.across + 2) % 3;
  if (layers.col(axes.between).maxCoeff() > layers.col(axes.along).maxCoeff())
    std::swap(axes.between, axes.along);
  return axes;
}

/// `nodes` along the lines of the lattice. A layer's surface vertices come before it: among its lines they
/// would only be in the way.
std::vector<int> order_along_lines(const VolumeGraph& volume, const std::vector<int>& nodes) {
  const Layers layers = lattice_layers(volume, nodes);
  const Axes axes = order_axes(layers);
  struct Place {
    std::array<int, 4> key;
    int node;
  };
  std::vector<Place> places;
  places.reserve(nodes.size());
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    const auto row = layers.row(static_cast<Eigen::Index>(k));
    const int inner = nodes[k] < volume.surface_count ? 0 : 1;
    places.push_back({{row[axes.across], inner, row[axes.between], row[axes.along]}, nodes[k]});
  }
  std::sort(places.begin(), places.end(),
            [](const Place& a, const Place& b) { return a.key != b.key ? a.key < b.key : a.node < b.node; });
  std::vector<int> order;
  order.reserve(nodes.size());
  for (const Place& place : places) order.push_back(place.node);
  return order;
}

std::vector<int> order_breadth_first(const Graph& graph, const std::vector<int>& nodes) {
  std::vector<int> order;
  order.reserve(nodes.size());
  for (const int place : breadth_first_order(induced_subgraph(graph, nodes))) order.push_back(nodes[place]);
  return order;
}

}  // namespace

FreeNodes order_free_nodes(const VolumeGraph& volume, const std::vector<bool>& constrained) {
  std::vector<int> nodes;
  for (int node = 0; node < volume.node_count(); ++node) {
    if (!constrained[node]) nodes.push_back(node);
  }
  const bool lattice = volume.interior == Interior::lattice && volume.node_count() > volume.surface_count;
  FreeNodes free;
  free.node_of_free =
      lattice && !nodes.empty() ? order_along_lines(volume, nodes) : order_breadth_first(volume.graph, nodes);
  free.free_of_node.assign(volume.node_count(), -1);
  for (int row = 0; row < free.count(); ++row) free.free_of_node[free.node_of_free[row]] = row;
  return free;
}

LinearSystem free_system(const VolumeGraph& volume, const FreeNodes& free) {
  const Graph& graph = volume.graph;
  LinearSystem system;
  system.graph = induced_subgraph(graph, free.node_of_free);
  system.anchor = Field::Zero(free.count());
  system.rest_positions.resize(free.count(), 3);
  for (int row = 0; row < free.count(); ++row) {
    const int node = free.node_of_free[row];
    system.rest_positions.row(row) = volume.rest_positions.row(node);
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
      if (free.free_of_node[graph.neighbors[k]] < 0) system.anchor[row] += graph.weights[k];
    }
  }
  return system;
}

}  // namespace sinew
