#include "pipeline/free_system.h"

namespace sinew {

FreeNodes order_free_nodes(const Graph& graph, const std::vector<bool>& constrained) {
  std::vector<int> nodes;
  for (int node = 0; node < graph.node_count(); ++node) {
    if (!constrained[node]) nodes.push_back(node);
  }
  FreeNodes free;
  free.free_of_node.assign(graph.node_count(), -1);
  for (const int place : breadth_first_order(induced_subgraph(graph, nodes))) {
    free.free_of_node[nodes[place]] = free.count();
    free.node_of_free.push_back(nodes[place]);
  }
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
