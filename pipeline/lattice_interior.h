#pragma once

#include <vector>

#include "pipeline/mesh.h"
#include "pipeline/solid.h"
#include "pipeline/volume_graph.h"
#include "solver/graph.h"
#include "solver/thread_team.h"

namespace sinew {

/// What lies below a surface: nodes numbered from mesh.vertex_count() up, and the edges among them
/// and to the surface vertices. Surface edges are not part of it.
struct InteriorNodes {
  Field3 positions;         ///< interior_count x 3, mesh space
  std::vector<Edge> edges;  ///< weight 1; an edge may come twice
};

/// Lattice constant that `options` ask for: `spacing` itself, or the one at which about `density`
/// nodes a surface vertex fit inside, or the default that VolumeGraphOptions describes. Throws
/// std::invalid_argument on a negative or infinite option, UnusableInput when the mesh has no extent or more
/// than max_nodes nodes are to be expected.
double lattice_spacing(const TriMesh& mesh, const Solid& solid, const VolumeGraphOptions& options,
                       ThreadTeam& team);

/// Body-centred-cubic lattice of constant `spacing` inside the surface, 14 neighbors a node.
///
/// A node stays 0.3 spacings away from the surface. A surface vertex is joined to the 4 nearest nodes
/// below it, or, where none fits, to the vertex on the opposite side of the body. Where a surface
/// overlaps itself, as thighs do, nothing is put: it would glue the two sides. Nodes that no surface
/// vertex reaches are dropped. Nodes come in scan order, the same for any team. O(nodes log nodes +
/// vertices log triangles).
InteriorNodes fill_with_lattice(const TriMesh& mesh, const Solid& solid, double spacing, ThreadTeam& team);

}  // namespace sinew
