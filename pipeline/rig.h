#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/binding.h"
#include "pipeline/harmonic_fields.h"
#include "pipeline/mesh.h"
#include "pipeline/subspace.h"
#include "pipeline/timing.h"
#include "pipeline/volume_graph.h"
#include "skeleton/rig_skeleton.h"
#include "solver/linear_solver.h"
#include "solver/multigrid.h"

namespace sinew {

enum class SolverKind { multigrid, cholesky, pcg };

struct RigOptions {
  /// Where neither spacing nor density is given, the lattice takes recommended_spacing().
  VolumeGraphOptions volume;
  BindingOptions binding;
  HarmonicFieldOptions fields;
  SolverKind solver = SolverKind::multigrid;
  MultigridOptions multigrid;
  SubspaceOf subspace = SubspaceOf::nothing;
};

/// Everything computed once for a mesh and a skeleton. Immutable afterwards and shared by all
/// frames; moving it is cheap and leaves nothing dangling.
struct Rig {
  TriMesh mesh;
  RigSkeleton skeleton;
  VolumeGraph volume;       ///< with the axis nodes the binding added
  Binding binding;
  HarmonicFields harmonics;
  /// The free nodes (those no position constraint holds) in the solver's order, and back: -1 where constrained.
  std::vector<int> node_of_free;
  std::vector<int> free_of_node;
  LinearSystem system;      ///< over the free nodes
  std::unique_ptr<const LinearSolver> solver;
  std::optional<Subspace> subspace;  ///< of what RigOptions::subspace names
  TimingReport timing;      ///< what each stage of building took
  std::vector<std::string> warnings;

  std::size_t bytes() const;
};

/// Volume graph, binding, harmonic fields, hierarchy: steps 3 and 4 of the main job. `team` is borrowed
/// and must outlive the rig. Throws UnusableInput when the skeleton does not fit the mesh.
Rig build_rig(const TriMesh& mesh, const RigSkeleton& skeleton, const RigOptions& options,
              ThreadTeam& team);

/// A solver of the wanted kind for `system`. `team` is borrowed.
std::unique_ptr<const LinearSolver> make_solver(SolverKind kind, const LinearSystem& system,
                                                const MultigridOptions& options, ThreadTeam& team);

}  // namespace sinew
