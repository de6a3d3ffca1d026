#pragma once

#include <optional>

#include "skeleton/retarget.h"

namespace sinew {

/// The motion of a rig that is the clip's own skeleton: joints of the same names, and a similarity lays
/// the clip's declared pose over the rig. Positions, stretch and scale come over as they are; only
/// `options.in_place` changes where the body goes. Nothing when the rig is another skeleton or has a map.
std::optional<Motion> overlay_motion(const Clip& clip, std::span<const Pose> frames, const RigSkeleton& rig,
                                     const RetargetOptions& options);

}  // namespace sinew
