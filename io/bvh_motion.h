#pragma once

#include <cstddef>
#include <vector>

#include "io/bvh_text.h"

namespace sinew {

struct BvhMotion {
  double frames_per_second = 30.0;
  int frame_count = 0;
  long first_line = 0;         ///< of the first row
  std::vector<double> values;  ///< frame * channel_count + channel; lengths and degrees as in the file
};

/// Reads what follows MOTION: two header lines and frames of `channel_count` values, at least one
/// frame. Memory is asked for by what the file holds, never by what it claims. Throws FileError.
BvhMotion read_bvh_motion(BvhText& text, std::size_t channel_count);

}  // namespace sinew
