#pragma once

#include <vector>

#include "pipeline/mesh.h"

namespace sinew::samples {

/// A closed, smooth, coloured surface.
struct ColouredMesh {
  TriMesh mesh;
  std::vector<Eigen::Vector3d> colours;  ///< per vertex, linear 0 to 1
};

/// The sample character: an ogre, 1.9 m tall, arms a little below a T, facing +z, its left at +x,
/// soles on y = 0. One closed component. `cell` is the edge of the sampling grid in metres and about the
/// length of the mesh's edges; the default gives some 19,000 vertices.
ColouredMesh make_ogre(double cell = 0.0154);

}  // namespace sinew::samples
