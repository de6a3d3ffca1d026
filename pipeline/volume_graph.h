#pragma once

#include <string>
#include <vector>

#include "pipeline/mesh.h"
#include "pipeline/solid.h"
#include "solver/graph.h"
#include "solver/thread_team.h"

namespace sinew {

/// What fills the body.
enum class Interior {
  lattice,  ///< body-centred-cubic lattice, 14 neighbours
  tetgen,   ///< tetrahedra from the worker program; falls back to the lattice with a warning
  none,     ///< the bare surface
};

struct VolumeGraphOptions {
  Interior interior = Interior::lattice;
  /// Lattice constant of the body-centred-cubic lattice, mesh unit; 0: from `density`.
  double spacing = 0.0;
  /// Interior nodes wanted per surface vertex; 0: spacing as QUALITY asks (1.25 mean surface edges).
  double density = 0.0;
  int max_nodes = 20'000'000;      ///< more is refused before memory is touched
  std::string tetgen_worker;       ///< path of sinew-tetgen; empty: looked for beside the program
  double worker_seconds = 60.0;    ///< wall-clock limit of the worker
  double worker_megabytes = 4096;  ///< memory limit of the worker
};

/// Mesh vertices, then interior points, joined by weighted edges.
///
/// The first surface_count nodes are the vertices of the TriMesh, in the same order: surface
/// positions are the top rows of any solution.
struct VolumeGraph {
  Graph graph;
  Field3 rest_positions;  ///< node_count x 3
  int surface_count = 0;
  double spacing = 0.0;   ///< lattice constant used, or the mean interior edge; 0 without interior
  Interior interior = Interior::none;  ///< what was really built, after any fallback
  std::vector<std::string> warnings;

  int node_count() const { return graph.node_count(); }
};

/// Fills `mesh` with interior nodes. Edges never leave the body: a link whose inside cannot be
/// confirmed is dropped. Weights are uniform. Linear in the number of nodes. Throws UnusableInput when the
/// mesh has no triangles. After [Zhou et al. 2005], which Shi 2006 builds on.
VolumeGraph build_volume_graph(const TriMesh& mesh, const Solid& solid,
                               const VolumeGraphOptions& options, ThreadTeam& team);

}  // namespace sinew
