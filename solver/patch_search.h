#pragma once

#include <vector>

#include "solver/hierarchy_levels.h"
#include "solver/thread_team.h"

/// Internal to solver/.
namespace sinew {

struct PatchSearch {
  std::vector<Patch> patches;
  LargeVector<KeptShare> kept;  ///< by node: what is left each cycle of an error without pattern, stubborn
                                ///< nodes being served by their patch
};

/// Finds the nodes of the finest level that the cycles of `hierarchy` serve badly, by trying: a few V-cycles
/// on A x = 0 from numbers without pattern leave most of them there, as in [Brezina et al. 2005]. Thin and
/// crowded parts are like that: an error that is smooth along the edges, so that sweeps hardly see it, may
/// still be too rough for the lattice. They and all nodes within two edges become patches. The numbers depend
/// on the nodes' order alone, so the answer depends on the hierarchy alone. Costs five V-cycles and the
/// factors; at most a twentieth of the nodes are found stubborn.
PatchSearch find_patches(const Hierarchy::Members& hierarchy, ThreadTeam& team);

}  // namespace sinew
