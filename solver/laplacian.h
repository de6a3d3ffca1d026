#pragma once

#include <Eigen/SparseCore>

#include "solver/field.h"
#include "solver/graph.h"

namespace sinew {

/// Our one Eigen sparse type: row-major, 32-bit indices.
using SparseMatrix = Eigen::SparseMatrix<double, Eigen::RowMajor, int>;

/// Weighted Laplacian of `graph`: A(i,i) is the sum of the weights at node i, A(i,j) = -w(i,j).
///
/// n x n with n = graph.node_count(); symmetric, positive semi-definite. Its null space is the
/// constants, one per connected part, so anchor a node in each part before solving.
/// Positive diagonal here; part of the literature has the opposite sign.
SparseMatrix laplacian(const Graph& graph);

/// The system every frame solves, over the free nodes only [Shi et al. 2006, eq. 11]:
///
///     sum_j w(i,j) (x_i - x_j) + anchor_i x_i = b_i
///
/// anchor_i is the sum of the weights from node i to constrained nodes, so the matrix is
/// laplacian(graph) + diag(anchor): symmetric positive definite once every component holds a node
/// with anchor > 0. Neighbors should be near each other in number, as in breadth_first_order: nothing depends
/// on it but speed.
struct LinearSystem {
  Graph graph;            ///< the free nodes and the edges among them
  Field anchor;           ///< n, >= 0
  Field3 rest_positions;  ///< n x 3; steers the coarsening only, never the equations
};

/// laplacian(system.graph) + diag(system.anchor). Throws std::invalid_argument when the anchor is not n
/// long.
SparseMatrix matrix(const LinearSystem& system);

/// Components of the system that hold no anchored node: there the matrix is singular. Empty when
/// all is well.
std::vector<int> unanchored_components(const LinearSystem& system, const Components& components);

/// out = b - A x, all n x k, without forming A. One pass over the edges. Resizes `out` where its
/// shape differs. Throws std::invalid_argument when b or x does not fit.
void residual(const LinearSystem& system, const Eigen::Ref<const Columns>& b,
              const Eigen::Ref<const Columns>& x, Columns& out);

/// The same into memory of the right shape, which is never resized.
void residual_into(const LinearSystem& system, const Eigen::Ref<const Columns>& b,
                   const Eigen::Ref<const Columns>& x, Eigen::Ref<Columns> out);

}  // namespace sinew
