#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sinew {

/// An undirected edge between two different nodes.
struct Edge {
  int a = 0;
  int b = 0;
  double weight = 1.0;  ///< positive
};

/// Undirected weighted graph. The neighbors of node i are neighbors[offsets[i]] up to, not
/// including, neighbors[offsets[i + 1]]; weights runs alongside.
struct Graph {
  std::vector<int> offsets = {0};  ///< node_count() + 1 entries, the first is 0
  std::vector<int> neighbors;      ///< every edge twice, i to j and j to i; ascending per node
  std::vector<double> weights;     ///< same length as neighbors, all positive

  int node_count() const { return static_cast<int>(offsets.size()) - 1; }
  std::int64_t edge_count() const { return static_cast<std::int64_t>(neighbors.size()) / 2; }
  int degree(int node) const { return offsets[node + 1] - offsets[node]; }
  std::span<const int> neighbors_of(int node) const {
    return {neighbors.data() + offsets[node], static_cast<std::size_t>(degree(node))};
  }
};

/// Builds a graph from edges in any order; an edge given twice (in either direction) is kept once,
/// with the larger weight. Throws std::invalid_argument on an index outside [0, node_count), a
/// loop, or a weight that is not positive and finite. O(nodes + edges log degree).
Graph make_graph(int node_count, std::span<const Edge> edges);

/// Part of `graph` spanned by `nodes` (each at most once): node k of the result is nodes[k].
Graph induced_subgraph(const Graph& graph, std::span<const int> nodes);

/// component[i] in [0, count) for each node; components are numbered by their smallest node.
struct Components {
  std::vector<int> component;
  int count = 0;
};
Components connected_components(const Graph& graph);

/// Nodes in breadth-first order, component by component, each from a node far from its middle:
/// neighbors end up close together in memory, which is what a sweep over the graph lives on.
/// order[k] is the node visited k-th. Deterministic. O(nodes + edges).
std::vector<int> breadth_first_order(const Graph& graph);

}  // namespace sinew
