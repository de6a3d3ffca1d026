#include "solver/graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace sinew {
namespace {

[[noreturn]] void refuse_edge(std::size_t index, const Edge& edge, const std::string& reason) {
  throw std::invalid_argument("make_graph: edge " + std::to_string(index) + " (" + std::to_string(edge.a) +
                              ", " + std::to_string(edge.b) + ") " + reason);
}

void check_edge(std::size_t index, const Edge& edge, int node_count) {
  if (edge.a < 0 || edge.b < 0 || edge.a >= node_count || edge.b >= node_count)
    refuse_edge(index, edge, "is outside the " + std::to_string(node_count) + " nodes");
  if (edge.a == edge.b) refuse_edge(index, edge, "joins a node to itself");
  if (!(edge.weight > 0) || !std::isfinite(edge.weight))
    refuse_edge(index, edge, "has weight " + std::to_string(edge.weight) + "; expected positive and finite");
}

struct Link {
  int neighbor;
  double weight;
};

std::vector<int> prefix_sums(std::vector<int> counts) {
  int sum = 0;
  for (int& count : counts) {
    const int own = count;
    count = sum;
    sum += own;
  }
  counts.push_back(sum);
  return counts;
}

// Both directions of every edge, grouped by the node they leave.
std::vector<Link> directed_links(std::span<const Edge> edges, const std::vector<int>& offsets) {
  std::vector<Link> links(static_cast<std::size_t>(offsets.back()));
  std::vector<int> next(offsets.begin(), offsets.end() - 1);
  for (const Edge& edge : edges) {
    links[next[edge.a]++] = {edge.b, edge.weight};
    links[next[edge.b]++] = {edge.a, edge.weight};
  }
  return links;
}

// Appends the links of one node, ascending, repeated neighbors once with their largest weight.
void append_node(std::span<Link> links, Graph& graph) {
  std::sort(links.begin(), links.end(), [](const Link& l, const Link& r) {
    return l.neighbor != r.neighbor ? l.neighbor < r.neighbor : l.weight > r.weight;
  });
  int previous = -1;
  for (const Link& link : links) {
    if (link.neighbor == previous) continue;
    graph.neighbors.push_back(link.neighbor);
    graph.weights.push_back(link.weight);
    previous = link.neighbor;
  }
  graph.offsets.push_back(static_cast<int>(graph.neighbors.size()));
}

// Visits the component of `start` breadth first, appending to `order`; returns the last node seen.
// `visited[i] == mark` tells the nodes of this visit from those of earlier ones.
int visit_component(const Graph& graph, int start, int mark, std::vector<int>& visited,
                    std::vector<int>& order) {
  std::size_t head = order.size();
  order.push_back(start);
  visited[start] = mark;
  for (; head < order.size(); ++head)
    for (int neighbor : graph.neighbors_of(order[head]))
      if (visited[neighbor] != mark) {
        visited[neighbor] = mark;
        order.push_back(neighbor);
      }
  return order.back();
}

}  // namespace

Graph make_graph(int node_count, std::span<const Edge> edges) {
  if (node_count < 0) throw std::invalid_argument("make_graph: node_count is " + std::to_string(node_count));
  if (edges.size() > static_cast<std::size_t>(std::numeric_limits<int>::max() / 2))
    throw std::invalid_argument("make_graph: " + std::to_string(edges.size()) +
                                " edges do not fit 32-bit offsets");
  std::vector<int> degrees(static_cast<std::size_t>(node_count), 0);
  for (std::size_t e = 0; e < edges.size(); ++e) {
    check_edge(e, edges[e], node_count);
    ++degrees[edges[e].a];
    ++degrees[edges[e].b];
  }
  const std::vector<int> offsets = prefix_sums(std::move(degrees));
  std::vector<Link> links = directed_links(edges, offsets);

  Graph graph;
  graph.offsets.reserve(static_cast<std::size_t>(node_count) + 1);
  graph.neighbors.reserve(links.size());
  graph.weights.reserve(links.size());
  for (int node = 0; node < node_count; ++node)
    append_node({links.data() + offsets[node], links.data() + offsets[node + 1]}, graph);
  return graph;
}

Graph induced_subgraph(const Graph& graph, std::span<const int> nodes) {
  std::vector<int> new_of_old(static_cast<std::size_t>(graph.node_count()), -1);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    if (nodes[k] < 0 || nodes[k] >= graph.node_count())
      throw std::invalid_argument("induced_subgraph: node " + std::to_string(nodes[k]) + " is outside the " +
                                  std::to_string(graph.node_count()) + " nodes");
    if (new_of_old[nodes[k]] >= 0)
      throw std::invalid_argument("induced_subgraph: node " + std::to_string(nodes[k]) + " is listed twice");
    new_of_old[nodes[k]] = static_cast<int>(k);
  }
  Graph part;
  std::vector<Link> links;
  for (int node : nodes) {
    links.clear();
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k)
      if (const int neighbor = new_of_old[graph.neighbors[k]]; neighbor >= 0)
        links.push_back({neighbor, graph.weights[k]});
    append_node(links, part);
  }
  return part;
}

Components connected_components(const Graph& graph) {
  Components result;
  result.component.assign(static_cast<std::size_t>(graph.node_count()), -1);
  std::vector<int> order;
  for (int node = 0; node < graph.node_count(); ++node) {
    if (result.component[node] >= 0) continue;
    order.clear();
    visit_component(graph, node, result.count++, result.component, order);
  }
  return result;
}

std::vector<int> breadth_first_order(const Graph& graph) {
  std::vector<int> visited(static_cast<std::size_t>(graph.node_count()), -1);
  std::vector<int> order;
  order.reserve(static_cast<std::size_t>(graph.node_count()));
  int mark = 0;
  for (int node = 0; node < graph.node_count(); ++node) {
    if (visited[node] >= 0) continue;
    // Two trial visits: the node seen last is far from where the visit began, and the one seen last
    // from there is close to an end of the component. Starting at an end keeps the fronts narrow.
    const std::size_t begin = order.size();
    int start = node;
    for (int trial = 0; trial < 2; ++trial) {
      start = visit_component(graph, start, mark++, visited, order);
      order.resize(begin);
    }
    visit_component(graph, start, mark++, visited, order);
  }
  return order;
}

}  // namespace sinew
