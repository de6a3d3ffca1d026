#pragma once

#include "skeleton/clip.h"
#include "skeleton/rig_skeleton.h"

namespace sinew::samples {

/// Where the ogre's joints are: the 22-joint canon, fingers as helpers of the hand.
RigSkeleton ogre_rig();

/// A clip skeleton with the ogre's proportions, standing in the ogre's rest pose when all rotations
/// are zero; names as Mixamo spells them.
Skeleton ogre_clip_skeleton();

/// A heavy walk along +z, 30 frames a second, four strides. The foot that carries the body does not slide.
Clip walk_clip();

/// Standing, the right arm goes up and waves; the head and trunk go along. 30 frames a second.
Clip wave_clip();

}  // namespace sinew::samples
