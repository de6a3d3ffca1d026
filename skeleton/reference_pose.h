#pragma once

#include <span>
#include <string>
#include <vector>

#include "skeleton/body.h"
#include "skeleton/clip.h"

namespace sinew {

/// The instant of a clip at which its body is compared with a body at rest.
struct ReferencePose {
  Pose pose;
  int frame = -1;         ///< of the clip; -1 for the pose its file declares (all channels at zero)
  bool standing = false;  ///< upright, limbs straight and symmetric: see stance_fault()
};

/// Which of +-x, +-y, +-z is up for the body: where the head is seen from the feet, over the frames
/// and in the declared pose. Files say it nowhere. Falls back to +y with a warning.
Eigen::Vector3d find_up_axis(const Clip& clip, const BodyJoints& joints, std::span<const Pose> frames,
                             std::vector<std::string>& warnings);

/// Whether the pose a file declares is no pose at all: most bones along one direction, as in files
/// whose joints carry their orientation in the channels, or the feet in one place.
bool is_degenerate(const Skeleton& skeleton, const Pose& declared, const BodyJoints& joints);

/// The declared pose if the body stands in it, else the frame that comes closest to standing. Bodies
/// that cannot be judged get the declared pose, or frame 0 where that is degenerate.
ReferencePose choose_reference(const Clip& clip, const BodyJoints& joints, std::span<const Pose> frames,
                               const Eigen::Vector3d& up);

/// Whether frame 0 is a reference pose put before the motion: the body stands in it, and the jump to
/// frame 1 is beyond anything that follows.
bool has_inserted_first_frame(std::span<const Pose> frames, const BodyJoints& joints,
                              const Eigen::Vector3d& up);

}  // namespace sinew
