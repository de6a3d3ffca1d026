#pragma once

#include "io/report.h"
#include "pipeline/animate.h"

/// Whether what a frame says of its error is true.
namespace sinew {

struct ErrorCheckResult {
  Spread difference;           ///< over the frames: largest distance of any node from the tight solve's
  double largest_ratio = 0.0;  ///< of that distance over the frame's own estimate
  int optimistic = 0;          ///< frames whose distance is more than twice their estimate
};

/// Solves the frames twice side by side, as `options` say and to 1e-6, the tight one from nothing of earlier
/// frames. Distances are shares of the rest box's diagonal. A refined frame's distance holds what its first
/// solves left in the rotations fitted to them too.
ErrorCheckResult check_errors(const Rig& rig, const Motion& motion, const AnimateOptions& options,
                              ThreadTeam& team);

}  // namespace sinew
