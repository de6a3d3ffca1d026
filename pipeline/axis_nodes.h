#pragma once

#include <vector>

#include "pipeline/bone_regions.h"

namespace sinew {

/// Which segments have too few interior nodes to be held by them: fewer than a handful in the
/// cylinder, or, where cores are wanted, a stretch of axis longer than the limb is thick without
/// one. Without interior: all.
std::vector<bool> thin_segments(const BoneRegions& regions, const VolumeGraph& volume,
                                const BindingOptions& options);

/// Appends nodes on the axes of the segments marked in `wanted`, about 20 each, links them in a
/// chain, across joints to one another, and to the nodes nearby that see them in a straight line
/// inside the body. All weights one.
void add_axis_nodes(const Solid& solid, const BoneRegions& regions, const std::vector<bool>& wanted,
                    VolumeGraph& volume);

}  // namespace sinew
