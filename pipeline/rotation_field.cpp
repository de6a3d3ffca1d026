// The first pass: [Shi et al. 2006, section 2] blends unit quaternions by harmonic weights. The halves
// of twisting bones are an addition.
#include "pipeline/rotation_field.h"

#include <algorithm>
#include <cmath>

namespace sinew {
namespace {

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

Eigen::Vector4f BoneTurn::at(float along) const {
  const float angle = half_twist * (along - 0.5f);
  return std::cos(angle) * middle + std::sin(angle) * across;
}

PoseRotations::PoseRotations(const RigSkeleton& skeleton, const Binding& binding) {
  for (const FieldSource& source : binding.fields) {
    const Bone& bone = binding.bones[source.bone];
    if (!source.far_end) {  // a far half shares the turn of the near half before it
      if (bone.twists) {
        twists_.push_back({static_cast<int>(turns_.size()), skeleton.joints[bone.joint].parent,
                           bone.twisted_by, bone.axis});
      }
      turns_.push_back({bone.joint, bone.twists});
    }
    turn_of_field_.push_back(static_cast<int>(turns_.size()) - 1);
    far_end_of_field_.push_back(source.far_end);
  }
  scale_of_field_.assign(turn_of_field_.size(), 1.0f);
}

void PoseRotations::read_twist(const Pose& pose, const TwistSource& source) {
  BoneTurn& turn = turns_[source.turn];
  const Eigen::Quaterniond& own = pose.rotations[turn.joint];
  double half_angle = 0.0;
  if (source.parent >= 0) {  // a root turns the whole body: nothing before it could take up its twist
    half_angle = half_twist_about(pose.rotations[source.parent].conjugate() * own, source.axis);
  }
  const Eigen::Quaterniond near = own * turn_about(source.axis, -half_angle);
  if (source.twisted_by >= 0) {
    half_angle += half_twist_about(own.conjugate() * pose.rotations[source.twisted_by], source.axis);
  }
  const Eigen::Quaterniond middle = near * turn_about(source.axis, 0.5 * half_angle);
  const Eigen::Quaterniond half_turn(0.0, source.axis.x(), source.axis.y(), source.axis.z());
  turn.half_twist = static_cast<float>(half_angle);
  turn.middle = middle.coeffs().cast<float>();
  turn.across = (middle * half_turn).coeffs().cast<float>();
}

void PoseRotations::read(const Pose& pose) {
  rigid_ = true;
  for (std::size_t field = 0; field < turn_of_field_.size(); ++field) {
    BoneTurn& turn = turns_[turn_of_field_[field]];
    const double scale = pose.scales[turn.joint];
    scale_of_field_[field] = static_cast<float>(scale);
    // Scales come out of cube roots: rounding alone must not make a rigid skeleton a growing one.
    constexpr double rounding = 1e-9;
    if (std::abs(scale - 1.0) > rounding) rigid_ = false;
    if (!turn.twists) turn.middle = pose.rotations[turn.joint].coeffs().cast<float>();
  }
  for (const TwistSource& source : twists_) read_twist(pose, source);
}

void PoseRotations::append_terms(const int* fields, const float* weights, int count,
                                 std::vector<BlendTerm>& terms) const {
  for (int k = 0; k < count; ++k) {
    const int field = fields[k];
    const int turn = turn_of_field_[field];
    if (!turns_[turn].twists) {
      terms.push_back({turn, weights[k], 0.0f});
      continue;
    }
    // Both halves of a bone lie side by side; either may have been too weak to store.
    float near = far_end_of_field_[field] ? 0.0f : weights[k];
    float far = far_end_of_field_[field] ? weights[k] : 0.0f;
    if (!far_end_of_field_[field] && k + 1 < count && fields[k + 1] == field + 1 && far_end_of_field_[field + 1]) {
      far = weights[++k];
    }
    terms.push_back({turn, near + far, far / (near + far)});
  }
}

Eigen::Quaternionf PoseRotations::blend(std::span<const BlendTerm> terms) const {
  Eigen::Vector4f sum = Eigen::Vector4f::Zero();
  for (const BlendTerm& term : terms) sum += term.weight * turns_[term.turn].at(term.along);
  if (sum.squaredNorm() < kLeastLength * kLeastLength) {
    const auto strongest =
        std::max_element(terms.begin(), terms.end(),
                         [](const BlendTerm& a, const BlendTerm& b) { return a.weight < b.weight; });
    sum = turns_[strongest->turn].at(strongest->along);
  }
  return Eigen::Quaternionf(sum.normalized());
}

float PoseRotations::blend_scale(const int* fields, const float* weights, int count) const {
  float sum = 0.0f;
  float total = 0.0f;
  for (int k = 0; k < count; ++k) {
    sum += weights[k] * scale_of_field_[fields[k]];
    total += weights[k];
  }
  return sum / total;
}

void blend_rotations(const HarmonicFields& fields, const PoseRotations& pose, ThreadTeam& team, RotationField& out) {
  const int node_count = fields.node_count();
  out.rotations.resize(node_count);
  out.scales.resize(node_count);
  team.for_each_block((node_count + kBlock - 1) / kBlock, [&](int block) {
    std::vector<BlendTerm> terms;
    for (int node = block * kBlock; node < std::min(node_count, (block + 1) * kBlock); ++node) {
      const int begin = fields.offsets[node];
      const int count = fields.offsets[node + 1] - begin;
      terms.clear();
      pose.append_terms(&fields.fields[begin], &fields.weights[begin], count, terms);
      out.rotations[node] = pose.blend(terms);
      out.scales[node] = pose.rigid() ? 1.0f : pose.blend_scale(&fields.fields[begin], &fields.weights[begin], count);
    }
  });
}

}  // namespace sinew
