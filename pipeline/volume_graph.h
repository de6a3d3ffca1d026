#pragma once

#include <Eigen/Geometry>
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
  /// Lattice constant of the body-centred-cubic lattice, mesh unit: 8 neighbors are sqrt(3)/2 of it
  /// away and 6 are all of it away. 0: from `density`. Tetrahedra are made about as fine.
  double spacing = 0.0;
  /// Interior nodes wanted per surface vertex, met within 10 %; 0: the nearest lattice neighbors are
  /// 1.25 mean surface edges apart (the spacing is 1.44 of them), or wider if that would be more
  /// than 5 nodes a vertex.
  double density = 0.0;
  int max_nodes = 20'000'000;      ///< more is refused before memory is touched
  std::string tetgen_worker = {};  ///< path of sinew-tetgen; empty: beside the program or on the PATH
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
  double spacing = 0.0;  ///< lattice constant used, or the mean interior edge; 0 without interior
  Interior interior = Interior::none;  ///< what was really built, after any fallback
  std::vector<std::string> warnings;

  int node_count() const { return graph.node_count(); }
};

/// Box of all nodes at rest.
Eigen::AlignedBox3d rest_box(const VolumeGraph& volume);
/// Length of its diagonal; 1 where it has none.
double rest_diagonal(const VolumeGraph& volume);

/// Fills `mesh`, of which `solid` was made, with interior nodes. Weights are uniform.
///
/// No edge to or among interior nodes leaves the body, and an interior node that no surface vertex
/// reaches is dropped: the graph is connected as the surface is, save where parts share an inside.
/// The two ends of a surface edge shorter than 0.4 of the mean of those round it get each other's
/// neighbors, so that a narrow seam between two limbs does not take up all their motion against each
/// other; two surface vertices so joined may have that short edge's width of outside between them.
/// When tetrahedra cannot be had the lattice takes their place, with the warning W_TETGEN_FALLBACK;
/// W_NO_INTERIOR says that no lattice node fits. Linear in the number of nodes.
///
/// Throws UnusableInput when the mesh has no triangles, a coordinate is not finite, or more than
/// max_nodes nodes are to be expected; std::invalid_argument on a negative option or a triangle that
/// names no vertex. After [Zhou et al. 2005], which Shi 2006 builds on.
VolumeGraph build_volume_graph(const TriMesh& mesh, const Solid& solid, const VolumeGraphOptions& options,
                               ThreadTeam& team);

}  // namespace sinew
