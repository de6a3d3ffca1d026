#include "skeleton/skeleton.h"

#include <stdexcept>

namespace sinew {

void check_skeleton(const Skeleton& skeleton, const char* who) {
  const std::size_t joints = skeleton.names.size();
  if (skeleton.parents.size() != joints || skeleton.rest.size() != joints || skeleton.tips.size() != joints) {
    throw std::invalid_argument(std::string(who) + ": the skeleton has " + std::to_string(joints) + " names, " +
                                std::to_string(skeleton.parents.size()) + " parents, " +
                                std::to_string(skeleton.rest.size()) + " rest transforms and " +
                                std::to_string(skeleton.tips.size()) + " lists of tips; expected as many of each");
  }
  for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
    const int parent = skeleton.parents[joint];
    if (parent >= -1 && parent < joint) continue;
    throw std::invalid_argument(std::string(who) + ": joint " + std::to_string(joint) + " '" + skeleton.names[joint] +
                                "' has parent " + std::to_string(parent) +
                                "; expected -1 or a joint before it");
  }
}

}  // namespace sinew
