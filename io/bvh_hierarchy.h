#pragma once

#include <vector>

#include "io/bvh_text.h"
#include "skeleton/skeleton.h"

namespace sinew {

/// One number of a motion row: which joint it moves, and how.
struct BvhChannel {
  enum class Kind { position, rotation };
  int joint = 0;
  Kind kind = Kind::rotation;
  int axis = 0;  ///< 0, 1, 2 for x, y, z
};

struct BvhHierarchy {
  Skeleton skeleton;
  std::vector<BvhChannel> channels;  ///< in the file's order, which is the order of the values in a row
};

/// Reads from HIERARCHY up to and with MOTION. Nesting costs heap, not stack. Throws FileError.
BvhHierarchy read_bvh_hierarchy(BvhText& text);

}  // namespace sinew
