#pragma once

#include <string>
#include <vector>

#include "skeleton/transform.h"

namespace sinew {

/// Joints of a motion file, parents before children. Identity is the index: names may repeat.
struct Skeleton {
  std::vector<std::string> names;
  std::vector<int> parents;      ///< -1 at a root; otherwise smaller than the joint's own index
  std::vector<Transform> rest;   ///< local, relative to the parent, as the file declares it
  /// End sites: offsets from the joint, in its frame. Usually one for a leaf, none elsewhere.
  std::vector<std::vector<Eigen::Vector3d>> tips;

  int joint_count() const { return static_cast<int>(names.size()); }
};

/// Throws std::invalid_argument, its message beginning with `who`, unless all four arrays have one
/// length and every parent comes before its children.
void check_skeleton(const Skeleton& skeleton, const char* who);

}  // namespace sinew
