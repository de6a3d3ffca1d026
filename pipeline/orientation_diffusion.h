#pragma once

#include <vector>

#include "pipeline/binding.h"
#include "pipeline/rotation_field.h"
#include "pipeline/volume_graph.h"

namespace sinew {

/// The reference for the first pass's quality [Shi et al. 2006, figure 2]: repeats
/// q_i <- normalise(sum_j w(i,j) q_j) over the graph, nodes with field constraints and glued nodes
/// keeping theirs, until no quaternion moves by more than `tolerance` or `most_sweeps` are done.
///
/// `start` is the field to begin with (rotations of all nodes, of which the kept ones stay): harmonic
/// blending's, for instance. Thousands of sweeps: for tests and comparisons.
std::vector<Eigen::Quaterniond> diffuse_orientations(const VolumeGraph& volume, const Binding& binding,
                                                     std::vector<Eigen::Quaterniond> start,
                                                     double tolerance = 1e-7, int most_sweeps = 20'000);

}  // namespace sinew
