#include "tools/bench/error_check.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "pipeline/mesh.h"

namespace sinew {
namespace {

constexpr double kTight = 1e-6;
constexpr double kOptimistic = 2.0;

}  // namespace

ErrorCheckResult check_errors(const Rig& rig, const Motion& motion, const AnimateOptions& options,
                              ThreadTeam& team) {
  FrameOptions tight_options = options.frame;
  tight_options.tolerance = kTight;
  tight_options.start = Start::zero;
  FrameSolver tight(rig, tight_options, team);
  Field3 wanted(rig.volume.node_count(), 3);
  Field3 found(rig.volume.node_count(), 3);
  const double diagonal = bounds(rig.mesh).diagonal();
  ErrorCheckResult result;
  std::vector<double> differences;
  FrameSolver solver(rig, options.frame, team);
  for (int frame = options.first_frame / options.chunk * options.chunk; frame <= options.last_frame;
       ++frame) {
    if (frame % options.chunk == 0) solver.forget();
    const FrameReport report = solver.solve(motion.poses[frame]);
    if (frame < options.first_frame) continue;
    tight.solve(motion.poses[frame]);
    solver.read_positions(found);
    tight.read_positions(wanted);
    const double difference = (found - wanted).rowwise().norm().maxCoeff() / diagonal;
    differences.push_back(difference);
    const double ratio = difference / std::max(report.error, kTight);
    result.largest_ratio = std::max(result.largest_ratio, ratio);
    if (ratio > kOptimistic) ++result.optimistic;
  }
  result.difference = spread_of(std::move(differences));
  return result;
}

}  // namespace sinew
