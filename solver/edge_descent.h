#pragma once

#include "solver/cycle.h"
#include "solver/edge_targets.h"

/// Internal to solver/: the full multigrid of Shi 2006, which carries the edges' targets to the coarse
/// levels.
namespace sinew {

/// What the edges of the coarse levels want, and every level's beta: three columns and a pad.
struct EdgeMemory {
  explicit EdgeMemory(const Hierarchy::Members& hierarchy);

  std::vector<AlignedMemory>
      wanted;                       ///< by level, entries rows; none for level 0, where the caller's are read
  std::vector<AlignedMemory> beta;  ///< by level, size rows
};

/// Full multigrid from zero with the paper's transfer for the original equation (14): the equations of
/// every level come from (19)-(22), and a coarse answer reaches the finer level along the edges' targets.
/// The answer is cycle.solution(). Works on any hierarchy that has descents.
void full_cycle_along_edges(const Hierarchy::Members& hierarchy, const EdgeTargets& targets, ThreadTeam& team,
                            EdgeMemory& memory, Cycle<4>& cycle);

}  // namespace sinew
