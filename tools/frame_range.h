#pragma once

#include <string>

namespace sinew {

/// Frames as people write them: "12", "1-100", "1-100x5", "-10--1"; 1-based, negative from the end.
struct FrameRange {
  int first = 1;
  int last = -1;
  int step = 1;
};

/// Throws std::invalid_argument saying what was found and what was expected.
FrameRange parse_frame_range(const std::string& text);

/// The same frames, 0-based and inside [0, frame_count): first, last (inclusive), step. Throws
/// std::invalid_argument when none is left.
FrameRange resolve(const FrameRange& range, int frame_count);

}  // namespace sinew
