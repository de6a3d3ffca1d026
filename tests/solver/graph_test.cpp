#include "solver/graph.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>

#include "graphs.h"
#include "refusal.h"

namespace sinew {
namespace {

TEST(Graph, lists_every_edge_from_both_ends_in_ascending_order) {
  const std::vector<Edge> edges = {{3, 1, 2.0}, {0, 3, 1.0}, {1, 0, 4.0}};
  const Graph graph = make_graph(4, edges);
  EXPECT_EQ(graph.offsets, (std::vector<int>{0, 2, 4, 4, 6}));
  EXPECT_EQ(graph.neighbors, (std::vector<int>{1, 3, 0, 3, 0, 1}));
  EXPECT_EQ(graph.weights, (std::vector<double>{4, 1, 4, 2, 1, 2}));
  EXPECT_EQ(graph.edge_count(), 3);
  EXPECT_EQ(graph.degree(2), 0);
}

TEST(Graph, keeps_a_repeated_edge_once_with_its_larger_weight) {
  const std::vector<Edge> edges = {{0, 1, 1.0}, {1, 0, 5.0}, {0, 1, 3.0}};
  const Graph graph = make_graph(2, edges);
  EXPECT_EQ(graph.neighbors, (std::vector<int>{1, 0}));
  EXPECT_EQ(graph.weights, (std::vector<double>{5, 5}));
}

TEST(Graph, may_be_empty) {
  EXPECT_EQ(make_graph(0, {}).node_count(), 0);
  EXPECT_EQ(connected_components(make_graph(0, {})).count, 0);
  EXPECT_TRUE(breadth_first_order(make_graph(0, {})).empty());
}

TEST(Graph, refuses_an_edge_that_is_none) {
  const auto making = [](Edge edge) { return [edge] { make_graph(3, std::vector<Edge>{{0, 1}, edge}); }; };
  EXPECT_EQ(refusal(making({0, 3, 1.0})), "make_graph: edge 1 (0, 3) is outside the 3 nodes");
  EXPECT_EQ(refusal(making({-1, 0, 1.0})), "make_graph: edge 1 (-1, 0) is outside the 3 nodes");
  EXPECT_EQ(refusal(making({2, 2, 1.0})), "make_graph: edge 1 (2, 2) joins a node to itself");
  EXPECT_EQ(refusal(making({0, 2, 0.0})),
            "make_graph: edge 1 (0, 2) has weight 0.000000; expected positive and finite");
  EXPECT_EQ(refusal(making({0, 2, std::numeric_limits<double>::infinity()})),
            "make_graph: edge 1 (0, 2) has weight inf; expected positive and finite");
}

TEST(Graph, a_subgraph_keeps_the_edges_among_its_nodes) {
  const std::vector<Edge> edges = {{0, 1, 1.0}, {1, 2, 2.0}, {2, 3, 3.0}, {3, 0, 4.0}};
  const Graph graph = make_graph(4, edges);
  const Graph part = induced_subgraph(graph, std::vector<int>{3, 0, 2});
  EXPECT_EQ(part.offsets, (std::vector<int>{0, 2, 3, 4}));
  EXPECT_EQ(part.neighbors, (std::vector<int>{1, 2, 0, 0}));
  EXPECT_EQ(part.weights, (std::vector<double>{4, 3, 4, 3}));
}

TEST(Graph, a_subgraph_refuses_nodes_it_cannot_have) {
  const Graph graph = make_graph(3, {});
  EXPECT_EQ(refusal([&] {
              induced_subgraph(graph, std::vector<int>{0, 3});
            }),
            "induced_subgraph: node 3 is outside the 3 nodes");
  EXPECT_EQ(refusal([&] {
              induced_subgraph(graph, std::vector<int>{1, 1});
            }),
            "induced_subgraph: node 1 is listed twice");
}

TEST(Graph, components_are_numbered_by_their_smallest_node) {
  const std::vector<Edge> edges = {{0, 4}, {1, 3}};
  const Components components = connected_components(make_graph(6, edges));
  EXPECT_EQ(components.count, 4);
  EXPECT_EQ(components.component, (std::vector<int>{0, 1, 2, 1, 0, 3}));
}

TEST(Graph, breadth_first_order_visits_every_node_once_and_brings_neighbors_together) {
  const graphs::Body body = graphs::bcc_dumbbell(5000);
  const std::vector<int> order = breadth_first_order(body.graph);
  std::vector<int> sorted = order;
  std::sort(sorted.begin(), sorted.end());
  std::vector<int> all(sorted.size());
  std::iota(all.begin(), all.end(), 0);
  ASSERT_EQ(sorted, all);

  const Graph ordered = induced_subgraph(body.graph, order);
  int farthest = 0;
  for (int i = 0; i < ordered.node_count(); ++i)
    for (int j : ordered.neighbors_of(i)) farthest = std::max(farthest, std::abs(i - j));
  EXPECT_LT(farthest, ordered.node_count() / 6);
}

TEST(Graph, breadth_first_order_of_a_path_walks_it_from_one_end) {
  const std::vector<int> order = breadth_first_order(graphs::path(50).graph);
  for (int k = 0; k + 1 < 50; ++k) EXPECT_EQ(std::abs(order[k] - order[k + 1]), 1);
}

}  // namespace
}  // namespace sinew
