#pragma once

#include <vector>

#include "io/morph_basis.h"

namespace sinew {

/// Frames to keep so that linear interpolation between kept neighbours brings every vertex of each
/// dropped frame within `tolerance` (a length) of the truth. The first and last are always kept; a
/// tolerance of 0 keeps all. Greedy from the front, runs of at most 64 frames.
/// O(vertices * frames * longest run).
std::vector<int> keys_to_keep(FrameSpan frames, double tolerance);

}  // namespace sinew
