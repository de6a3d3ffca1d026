#pragma once

#include <vector>

#include "io/morph_basis.h"
#include "io/surface_normals.h"

namespace sinew {

/// Morph normals of every target of `clip`, three floats a group of `normals`, that with the clip's
/// weights come nearest to the true normals of all frames in the least-squares sense. Normals are not
/// linear in the shape; this is the best that a linear blend of them can do.
/// O(triangles * frames + groups * frames * targets).
std::vector<std::vector<float>> fit_morph_normals(const SurfaceNormals& normals, FrameSpan frames,
                                                  const RigidMotion& motion, const MorphClip& clip);

}  // namespace sinew
