#include "pipeline/orientation_diffusion.h"

#include <algorithm>

namespace sinew {

std::vector<Eigen::Quaterniond> diffuse_orientations(const VolumeGraph& volume, const Binding& binding,
                                                     std::vector<Eigen::Quaterniond> start, double tolerance,
                                                     int most_sweeps) {
  std::vector<bool> kept(volume.node_count(), false);
  for (const FieldConstraint& constraint : binding.field_constraints) kept[constraint.node] = true;
  for (const auto& [node, bone] : binding.glued) kept[node] = true;
  for (int sweep = 0; sweep < most_sweeps; ++sweep) {
    double largest_move = 0.0;
    for (int node = 0; node < volume.node_count(); ++node) {
      if (kept[node]) continue;
      Eigen::Vector4d sum = Eigen::Vector4d::Zero();
      for (int k = volume.graph.offsets[node]; k < volume.graph.offsets[node + 1]; ++k) {
        sum += volume.graph.weights[k] * start[volume.graph.neighbors[k]].coeffs();
      }
      const double norm = sum.norm();
      if (!(norm > 0.0)) continue;
      largest_move = std::max(largest_move, (sum / norm - start[node].coeffs()).norm());
      start[node].coeffs() = sum / norm;
    }
    if (largest_move <= tolerance) break;
  }
  return start;
}

}  // namespace sinew
