#pragma once

#include <string>
#include <vector>

#include "pipeline/binding.h"
#include "pipeline/volume_graph.h"
#include "solver/linear_solver.h"
#include "solver/thread_team.h"

namespace sinew {

struct HarmonicFieldOptions {
  double tolerance = 1e-6;   ///< relative residual of the solves
  double drop_below = 1e-4;  ///< smaller weights are not stored; the rest is scaled to sum to one
};

/// Per node, how much it listens to each field: sparse rows, values in [0, 1], summing to one.
struct HarmonicFields {
  int field_count = 0;
  std::vector<int> offsets;     ///< node_count + 1
  std::vector<int> fields;      ///< ascending per node
  std::vector<float> weights;
  SolveReport solve;
  std::vector<std::string> warnings;

  std::size_t bytes() const;
};

/// Solves all bounded harmonic fields of the first pass together [Shi et al. 2006, section 2].
HarmonicFields solve_harmonic_fields(const VolumeGraph& volume, const Binding& binding,
                                     const HarmonicFieldOptions& options, ThreadTeam& team);

}  // namespace sinew
