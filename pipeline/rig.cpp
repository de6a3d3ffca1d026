#include "pipeline/rig.h"

#include <utility>

#include "pipeline/free_system.h"
#include "pipeline/solid.h"
#include "solver/cholesky.h"
#include "solver/conjugate_gradients.h"

namespace sinew {
namespace {

VolumeGraphOptions with_spacing(const TriMesh& mesh, const Solid& solid, const RigSkeleton& skeleton,
                                const RigOptions& options) {
  VolumeGraphOptions volume = options.volume;
  if (volume.interior != Interior::none && volume.spacing == 0.0 && volume.density == 0.0) {
    volume.spacing = recommended_spacing(mesh, solid, skeleton, options.binding);
  }
  return volume;
}

Solid timed_solid(const TriMesh& mesh, TimingReport& timing) {
  const auto timer = timing.time("solid");
  return Solid(mesh);
}

FreeNodes find_free_nodes(const VolumeGraph& volume, const Binding& binding) {
  std::vector<bool> constrained(volume.node_count(), false);
  for (const SphereConstraint& constraint : binding.spheres) constrained[constraint.node] = true;
  for (const CoreConstraint& constraint : binding.cores) constrained[constraint.node] = true;
  for (const auto& [node, bone] : binding.glued) constrained[node] = true;
  return order_free_nodes(volume, constrained);
}

void append(std::vector<std::string>& all, const std::vector<std::string>& some) {
  all.insert(all.end(), some.begin(), some.end());
}

template <typename T>
std::size_t bytes_of(const std::vector<T>& values) {
  return values.size() * sizeof(T);
}

std::size_t bytes_of(const Graph& graph) {
  return bytes_of(graph.offsets) + bytes_of(graph.neighbors) + bytes_of(graph.weights);
}

template <typename Matrix>
std::size_t bytes_of_matrix(const Matrix& matrix) {
  return static_cast<std::size_t>(matrix.size()) * sizeof(double);
}

}  // namespace

std::size_t Rig::bytes() const {
  return bytes_of_matrix(mesh.positions) + bytes_of(mesh.triangles) + bytes_of(volume.graph) +
         bytes_of_matrix(volume.rest_positions) + bytes_of(binding.field_constraints) + bytes_of(binding.spheres) +
         bytes_of(binding.cores) + bytes_of(binding.glued) + harmonics.bytes() + bytes_of(node_of_free) +
         bytes_of(free_of_node) + bytes_of(system.graph) + bytes_of_matrix(system.anchor) +
         bytes_of_matrix(system.rest_positions) + (solver ? solver->bytes() : 0) + (subspace ? subspace->bytes() : 0);
}

std::unique_ptr<const LinearSolver> make_solver(SolverKind kind, const LinearSystem& system,
                                                const MultigridOptions& options, ThreadTeam& team) {
  switch (kind) {
    case SolverKind::cholesky:
      return std::make_unique<CholeskySolver>(system);
    case SolverKind::pcg:
      return std::make_unique<ConjugateGradientSolver>(system);
    case SolverKind::multigrid:
      break;
  }
  return std::make_unique<MultigridSolver>(system, options, team);
}

Rig build_rig(const TriMesh& mesh, const RigSkeleton& skeleton, const RigOptions& options, ThreadTeam& team) {
  check_rig_skeleton(skeleton, "build_rig");
  Rig rig;
  rig.mesh = mesh;
  rig.skeleton = skeleton;
  const Solid solid = timed_solid(mesh, rig.timing);
  {
    const auto timer = rig.timing.time("volume graph");
    rig.volume = build_volume_graph(mesh, solid, with_spacing(mesh, solid, skeleton, options), team);
  }
  {
    const auto timer = rig.timing.time("binding");
    rig.binding = bind(mesh, solid, skeleton, options.binding, rig.volume);
  }
  {
    const auto timer = rig.timing.time("harmonic fields");
    rig.harmonics = solve_harmonic_fields(rig.volume, rig.binding, options.fields, team);
  }
  {
    const auto timer = rig.timing.time("system");
    FreeNodes free = find_free_nodes(rig.volume, rig.binding);
    rig.system = free_system(rig.volume, free);
    rig.node_of_free = std::move(free.node_of_free);
    rig.free_of_node = std::move(free.free_of_node);
  }
  {
    const auto timer = rig.timing.time("solver");
    if (!rig.node_of_free.empty()) rig.solver = make_solver(options.solver, rig.system, options.multigrid, team);
  }
  if (options.subspace != SubspaceOf::nothing) {
    const auto timer = rig.timing.time("subspace");
    rig.subspace.emplace(rig, options.subspace, team);
  }
  append(rig.warnings, rig.volume.warnings);
  append(rig.warnings, rig.binding.warnings);
  append(rig.warnings, rig.harmonics.warnings);
  append(rig.warnings, unbalanced_joints(skeleton, rig.binding, rig.harmonics));
  return rig;
}

}  // namespace sinew
