#pragma once

#include "solver/hierarchy_levels.h"
#include "solver/thread_team.h"

/// Internal to solver/.
namespace sinew {

/// P^T A P for the interpolation P of `transfer`: symmetric, positive semi-definite, and blind to the
/// constants where A is. Summed in double, stored in single precision. The same for any team. O(entries of
/// A).
LevelMatrix galerkin_product(const LevelMatrix& A, const PieceTransfer& transfer, ThreadTeam& team);

/// Fills the parts that follow from offsets, neighbors and diagonal: the inverse diagonal and the sweep
/// blocks.
void finish_level(LevelMatrix& matrix);

/// In double, for the factorisation of the last level.
SparseMatrix to_sparse(const LevelMatrix& matrix);

}  // namespace sinew
