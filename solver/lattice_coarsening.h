#pragma once

#include <Eigen/Geometry>

#include "solver/field.h"
#include "solver/hierarchy_levels.h"
#include "solver/thread_team.h"

/// Internal to solver/: where the coarse nodes of the default hierarchy come from.
namespace sinew {

/// A transfer to a coarser level and where that level's nodes are.
struct PieceCoarsening {
  PieceTransfer transfer;
  Field3 positions;  ///< of the coarse nodes, n_coarse x 3, in units of the lattice cell (a fresh origin)
};

/// The smallest box around the positions; empty where there are none, or one is not finite.
Eigen::AlignedBox3d box_around(const Field3& positions, ThreadTeam& team);

/// Mean distance between neighbors, of ten thousand evenly spread nodes or more in a larger graph; 0 for a
/// graph without edges. The same for any team.
double mean_edge_length(const LevelMatrix& matrix, const Field3& positions, ThreadTeam& team);

/// Cells a lattice may have along an axis: beyond, the coarsening is left to the aggregates.
constexpr double kMostCellsAlong = 1 << 20;

/// Coarse nodes at the corners of cubic cells of edge `cell`. Nodes of a cell that do not hang together
/// inside it get corners of their own (so that two parts that merely pass near each other stay
/// independent); corners of neighboring cells are one coarse node where the graph joins their pieces.
/// Interpolation is trilinear, so linear functions of the positions are reproduced exactly. After the
/// virtual nodes of [Molino, Bao, Fedkiw 2004]. The positions are finite and span fewer than kMostCellsAlong
/// cells. The same for any team. O(nodes + edges).
PieceCoarsening coarsen_by_lattice(const LevelMatrix& matrix, const Field3& positions, double cell,
                                   ThreadTeam& team);

/// Coarse nodes that each stand for a node and its neighbors: for graphs without usable positions, or
/// so sparse that lattice corners would outnumber the nodes. Nodes without neighbors get no coarse
/// node, since a sweep solves them exactly. [Vaněk, Mandel, Brezina 1996]. O(nodes + edges).
PieceCoarsening coarsen_by_aggregation(const LevelMatrix& matrix, const Field3& positions);

/// The eight trilinear weights of a place in its cell, corner k at (k & 1, k >> 1 & 1, k >> 2 & 1).
void trilinear_weights(const float* place, float* weights);

}  // namespace sinew
