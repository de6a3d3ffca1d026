#include "pipeline/skinning.h"

#include <vector>

namespace sinew {
namespace {

/// A rigid motion x -> q x q* + t as q + e/2 t q.
struct DualQuaternion {
  Eigen::Vector4d real;  ///< x y z w
  Eigen::Vector4d dual;
};

Eigen::Vector3d rest_position(const Rig& rig, int joint) { return rig.skeleton.joints[joint].position; }

/// Calls body(bone, weight) for each stored weight of the node, a twisting bone's halves one by one.
template <typename Body>
void for_each_bone(const Rig& rig, int node, const Body& body) {
  const HarmonicFields& fields = rig.harmonics;
  for (int k = fields.offsets[node]; k < fields.offsets[node + 1]; ++k) {
    body(rig.binding.fields[fields.fields[k]].bone, static_cast<double>(fields.weights[k]));
  }
}

DualQuaternion motion_of(const Rig& rig, const Bone& bone, const Pose& pose) {
  const Eigen::Quaterniond& turn = pose.rotations[bone.joint];
  const Eigen::Vector3d shift = pose.positions[bone.joint] - turn * rest_position(rig, bone.joint);
  const Eigen::Quaterniond half_shift(0.0, 0.5 * shift.x(), 0.5 * shift.y(), 0.5 * shift.z());
  return {turn.coeffs(), (half_shift * turn).coeffs()};
}

Eigen::Vector3d carry(const DualQuaternion& motion, const Eigen::Vector3d& point) {
  const double norm = motion.real.norm();
  const Eigen::Quaterniond turn(motion.real / norm);
  const Eigen::Quaterniond dual(motion.dual / norm);
  return turn * point + 2.0 * (dual * turn.conjugate()).vec();
}

}  // namespace

void linear_blend_skinning(const Rig& rig, const Pose& pose, Field3& positions) {
  for (int node = 0; node < rig.volume.node_count(); ++node) {
    const Eigen::Vector3d rest = rig.volume.rest_positions.row(node).transpose();
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for_each_bone(rig, node, [&](int bone, double weight) {
      const int joint = rig.binding.bones[bone].joint;
      const Eigen::Vector3d arm = pose.scales[joint] * (rest - rest_position(rig, joint));
      mean += weight * (pose.positions[joint] + pose.rotations[joint] * arm);
    });
    positions.row(node) = mean.transpose();
  }
}

void dual_quaternion_skinning(const Rig& rig, const Pose& pose, Field3& positions) {
  std::vector<DualQuaternion> motions;
  for (const Bone& bone : rig.binding.bones) motions.push_back(motion_of(rig, bone, pose));
  for (int node = 0; node < rig.volume.node_count(); ++node) {
    DualQuaternion sum{Eigen::Vector4d::Zero(), Eigen::Vector4d::Zero()};
    for_each_bone(rig, node, [&](int bone, double weight) {
      sum.real += weight * motions[bone].real;
      sum.dual += weight * motions[bone].dual;
    });
    positions.row(node) = carry(sum, rig.volume.rest_positions.row(node).transpose()).transpose();
  }
}

}  // namespace sinew
