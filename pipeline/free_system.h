#pragma once

#include <vector>

#include "pipeline/volume_graph.h"
#include "solver/laplacian.h"

namespace sinew {

/// The nodes that are solved for, in the solver's order, and back: -1 where a node is constrained.
struct FreeNodes {
  std::vector<int> node_of_free;
  std::vector<int> free_of_node;

  int count() const { return static_cast<int>(node_of_free.size()); }
};

/// Orders the nodes that are not `constrained` so that neighbors are near each other: along the lines of the
/// lattice, line after line and layer after layer, the layers across the axis that makes them thinnest and the
/// surface vertices of a layer before its lines; or, where there is no lattice, breadth-first over the graph they
/// span. O(n log n).
FreeNodes order_free_nodes(const VolumeGraph& volume, const std::vector<bool>& constrained);

/// The system over the free nodes: their graph, and the weights to constrained neighbors as anchors.
LinearSystem free_system(const VolumeGraph& volume, const FreeNodes& free);

}  // namespace sinew
