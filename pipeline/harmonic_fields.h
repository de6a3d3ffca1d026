#pragma once

#include <cstddef>
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
  SolveReport solve;            ///< the worst of the solves
  std::vector<std::string> warnings;  ///< solves that missed their tolerance

  int node_count() const { return static_cast<int>(offsets.size()) - 1; }
  /// Weight of `field` at `node`; zero where it is not stored.
  double weight(int node, int field) const;
  std::size_t bytes() const;
};

/// Solves all bounded harmonic fields of the first pass [Shi et al. 2006, section 2]: boundary values
/// from Binding::field_constraints, glued nodes listening to their bone alone. Fields share one matrix
/// and are solved side by side, a block of columns at a time so that memory stays near that of one
/// frame. Every component of the graph must hold a constrained or only glued nodes, as bind() leaves it.
HarmonicFields solve_harmonic_fields(const VolumeGraph& volume, const Binding& binding,
                                     const HarmonicFieldOptions& options, ThreadTeam& team);

/// One warning per joint between two bones where the parent's and the child's fields are out of
/// balance: the child's share of the two, over the nodes the joint holds, is outside 0.25 to 0.75.
std::vector<std::string> unbalanced_joints(const RigSkeleton& skeleton, const Binding& binding,
                                           const HarmonicFields& fields);

}  // namespace sinew
