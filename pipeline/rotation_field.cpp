// The first pass: [Shi et al. 2006, section 2] blends unit quaternions by harmonic weights. The halves
// of twisting bones are an addition.
#include "pipeline/rotation_field.h"

#include <cmath>

namespace sinew {
namespace {

/// Steps in which a bone's twist is tabulated. Between steps quaternions are interpolated linearly:
/// for a full turn that is wrong by less than 1e-4 of a radian.
constexpr int kTwistSteps = 64;

/// Nodes per block of parallel work.
constexpr int kBlock = 4096;

Eigen::Quaterniond turn_about(const Eigen::Vector3d& axis, double half_angle) {
  const Eigen::Vector3d v = std::sin(half_angle) * axis;
  return {std::cos(half_angle), v.x(), v.y(), v.z()};
}

}  // namespace

double half_twist_about(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& axis) {
  const double along = rotation.vec().dot(axis);
  const double share = std::hypot(rotation.w(), along);  // the cosine of half the swing
  constexpr double faded = 0.25;
  const double step = std::min(1.0, share / faded);
  const double fade = step * step * (3.0 - 2.0 * step);
  return fade * std::atan2(along, rotation.w());
}

PoseRotations::PoseRotations(const RigSkeleton& skeleton, const Binding& binding) {
  std::vector<int> twist_of_bone(binding.bones.size(), -1);
  for (std::size_t k = 0; k < binding.bones.size(); ++k) {
    const Bone& bone = binding.bones[k];
    if (!bone.twists) continue;
    twist_of_bone[k] = static_cast<int>(twists_.size());
    twists_.push_back({bone.joint, skeleton.joints[bone.joint].parent, bone.twisted_by, bone.axis});
  }
  for (const FieldSource& source : binding.fields) {
    joint_of_field_.push_back(binding.bones[source.bone].joint);
    fields_.push_back({Eigen::Vector4d(0, 0, 0, 1), 1.0, twist_of_bone[source.bone], source.far_end});
  }
  tables_.assign(twists_.size() * (kTwistSteps + 1), Eigen::Vector4d(0, 0, 0, 1));
}

void PoseRotations::read_twist(const Pose& pose, int twist) {
  const TwistSource& source = twists_[twist];
  const Eigen::Quaterniond& own = pose.rotations[source.joint];
  double half_angle = 0.0;
  if (source.parent >= 0) {  // a root turns the whole body: nothing before it could take up its twist
    half_angle = half_twist_about(pose.rotations[source.parent].conjugate() * own, source.axis);
  }
  const Eigen::Quaterniond near = own * turn_about(source.axis, -half_angle);
  if (source.twisted_by >= 0) {
    half_angle += half_twist_about(own.conjugate() * pose.rotations[source.twisted_by], source.axis);
  }
  for (int step = 0; step <= kTwistSteps; ++step) {
    const Eigen::Quaterniond turn = turn_about(source.axis, half_angle * step / kTwistSteps);
    tables_[twist * (kTwistSteps + 1) + step] = (near * turn).coeffs();
  }
}

void PoseRotations::read(const Pose& pose) {
  rigid_ = true;
  for (int twist = 0; twist < static_cast<int>(twists_.size()); ++twist) read_twist(pose, twist);
  for (std::size_t field = 0; field < fields_.size(); ++field) {
    const int joint = joint_of_field_[field];
    fields_[field].rotation = pose.rotations[joint].coeffs();
    fields_[field].scale = pose.scales[joint];
    // Scales come out of cube roots: rounding alone must not make a rigid skeleton a growing one.
    constexpr double rounding = 1e-9;
    if (std::abs(pose.scales[joint] - 1.0) > rounding) rigid_ = false;
  }
}

Eigen::Vector4d PoseRotations::at_twist(int twist, double share) const {
  const Eigen::Vector4d* table = tables_.data() + twist * (kTwistSteps + 1);
  const double place = share * kTwistSteps;
  const int below = std::min(static_cast<int>(place), kTwistSteps - 1);
  const double rest = place - below;
  return (1.0 - rest) * table[below] + rest * table[below + 1];
}

Eigen::Quaterniond PoseRotations::blend(const int* fields, const float* weights, int count) const {
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  int strongest = 0;
  for (int k = 0; k < count; ++k) {
    if (weights[k] > weights[strongest]) strongest = k;
    const FieldRotation& field = fields_[fields[k]];
    if (field.twist < 0) {
      sum += static_cast<double>(weights[k]) * field.rotation;
      continue;
    }
    // Both halves of a bone lie side by side; either may have been too weak to store.
    double near = field.far_end ? 0.0 : weights[k];
    double far = field.far_end ? weights[k] : 0.0;
    if (!field.far_end && k + 1 < count && fields[k + 1] == fields[k] + 1 && fields_[fields[k + 1]].far_end) {
      ++k;
      far = weights[k];
      if (weights[k] > weights[strongest]) strongest = k;
    }
    sum += (near + far) * at_twist(field.twist, far / (near + far));
  }
  const double norm = sum.norm();
  constexpr double least = 1e-6;  // opposite bones cancel: no mean exists, the strongest bone decides
  return norm < least ? of_field(fields[strongest]) : Eigen::Quaterniond(sum / norm);
}

double PoseRotations::blend_scale(const int* fields, const float* weights, int count) const {
  double sum = 0.0;
  double total = 0.0;
  for (int k = 0; k < count; ++k) {
    sum += static_cast<double>(weights[k]) * fields_[fields[k]].scale;
    total += static_cast<double>(weights[k]);
  }
  return sum / total;
}

Eigen::Quaterniond PoseRotations::of_field(int field) const {
  const FieldRotation& carried = fields_[field];
  if (carried.twist < 0) return Eigen::Quaterniond(carried.rotation);
  return Eigen::Quaterniond(at_twist(carried.twist, carried.far_end ? 1.0 : 0.0));
}

void blend_rotations(const HarmonicFields& fields, const PoseRotations& pose, ThreadTeam& team, RotationField& out) {
  const int node_count = fields.node_count();
  out.rotations.resize(node_count);
  out.scales.resize(node_count);
  team.for_each_block((node_count + kBlock - 1) / kBlock, [&](int block) {
    for (int node = block * kBlock; node < std::min(node_count, (block + 1) * kBlock); ++node) {
      const int begin = fields.offsets[node];
      const int count = fields.offsets[node + 1] - begin;
      out.rotations[node] = pose.blend(&fields.fields[begin], &fields.weights[begin], count);
      out.scales[node] = pose.rigid() ? 1.0 : pose.blend_scale(&fields.fields[begin], &fields.weights[begin], count);
    }
  });
}

}  // namespace sinew
