#include "skeleton/rig_skeleton.h"

#include <cmath>
#include <stdexcept>
#include <string_view>

namespace sinew {
namespace {

void require(bool holds, const char* who, const std::string& what) {
  if (!holds) throw std::invalid_argument(std::string(who) + ": " + what);
}

bool is_direction(const Eigen::Vector3d& vector) { return vector.allFinite() && vector.squaredNorm() > 0.0; }

bool is_radius(const std::optional<double>& radius) {
  return !radius || (std::isfinite(*radius) && *radius > 0.0);
}

void check_joint(const RigJoint& joint, int index, const char* who) {
  const std::string name = "joint " + std::to_string(index) + " '" + joint.name + "'";
  require(joint.parent >= -1 && joint.parent < index, who,
          name + " has parent " + std::to_string(joint.parent) + "; expected -1 or a joint before it");
  require(joint.position.allFinite(), who, name + " has a position that is not finite");
  require(!joint.tip || joint.tip->allFinite(), who, name + " has a tip that is not finite");
  require(is_radius(joint.cylinder_radius) && is_radius(joint.sphere_radius), who,
          name + " has a radius that is not positive");
  for (const Segment& helper : joint.helpers) {
    require(helper.from.allFinite() && helper.to.allFinite(), who, name + " has a helper that is not finite");
  }
}

}  // namespace

std::vector<int> RigSkeleton::parents() const {
  std::vector<int> result;
  result.reserve(joints.size());
  for (const RigJoint& joint : joints) result.push_back(joint.parent);
  return result;
}

int RigSkeleton::find(std::string_view name) const {
  for (int joint = 0; joint < joint_count(); ++joint) {
    if (joints[joint].name == name) return joint;
  }
  return -1;
}

Pose rest_pose(const RigSkeleton& rig) {
  Pose pose;
  for (const RigJoint& joint : rig.joints) pose.positions.push_back(joint.position);
  pose.rotations.assign(rig.joints.size(), Eigen::Quaterniond::Identity());
  pose.scales.assign(rig.joints.size(), 1.0);
  return pose;
}

void check_rig_skeleton(const RigSkeleton& rig, const char* who) {
  require(is_direction(rig.up), who, "the rig's up direction is not a direction");
  require(is_direction(rig.front), who, "the rig's front direction is not a direction");
  for (int joint = 0; joint < rig.joint_count(); ++joint) check_joint(rig.joints[joint], joint, who);
}

}  // namespace sinew
