#pragma once

#include "solver/hierarchy_levels.h"
#include "solver/linear_solver.h"

/// Internal to solver/.
namespace sinew {

/// Cost of one Cycle<4>::v_cycle (Reach::near and light) or full_cycle (Reach::far, and whole with a V-cycle
/// at its end), counted from the arrays each of its passes walks: every array once a pass, gathered rows once
/// however often they are read.
CycleCost cycle_cost(const Hierarchy::Members& hierarchy, int sweeps, Reach reach);

}  // namespace sinew
