#pragma once

#include "pipeline/rig.h"
#include "skeleton/pose.h"

namespace sinew {

/// What the method is compared with: skinning in closed form, with a rig's harmonic fields as weights
/// (the halves of a twisting bone added up). Both fill `positions` for every node of the rig's graph,
/// node_count x 3, and cost one pass over the weights.

/// Linear blend skinning: each node the mean of where its bones would carry it.
void linear_blend_skinning(const Rig& rig, const Pose& pose, Field3& positions);

/// Dual quaternion skinning [Kavan et al. 2008]: rigid motions blended as unit dual quaternions. Scales of
/// the pose are left out.
void dual_quaternion_skinning(const Rig& rig, const Pose& pose, Field3& positions);

}  // namespace sinew
