#pragma once

#include "solver/hierarchy_levels.h"
#include "solver/laplacian.h"

/// Internal to solver/: one step of Shi 2006's coarsening.
namespace sinew {

/// A coarser system and both of the paper's ways to reach it.
struct ShiCoarsening {
  LinearSystem coarse;  ///< weights (19), anchors (21), positions of the elevated nodes
  RowTransfer defect;   ///< eq. (17)
  EdgeDescent descent;  ///< eqs. (14), (20), (22)
};

/// Elevates a maximal set of nodes of which no two are joined by an edge shorter than delta = mean edge
/// length * 5^(1/3), swept greedily in the order of the nodes, so that every retained node has an
/// elevated neighbor. Dropping the edges between retained nodes makes each depend on elevated ones
/// alone (14); putting that into the elevated nodes' equations gives the coarse system, which is the
/// exact Schur complement of the pruned one. O(nodes + two-step paths).
ShiCoarsening coarsen_by_independent_set(const LinearSystem& fine);

}  // namespace sinew
