// The first pass: [Shi et al. 2006, section 2] blends unit quaternions by harmonic weights. The halves
// of twisting bones are an addition.
#include "pipeline/rotation_field.h"

#include <algorithm>
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
  int places = 0;
  for (const FieldSource& source : binding.fields) {
    const Bone& bone = binding.bones[source.bone];
    joint_of_field_.push_back(bone.joint);
    twists_of_field_.push_back(bone.twists);
    far_end_of_field_.push_back(source.far_end);
    // A far half shares the table of the near half before it.
    place_of_field_.push_back(source.far_end ? place_of_field_.back() : places);
    if (source.far_end) continue;
    if (bone.twists) {
      twists_.push_back({bone.joint, skeleton.joints[bone.joint].parent, bone.twisted_by, bone.axis, places});
    }
    ranges_.push_back({bone.joint, places, bone.twists ? kTwistSteps + 1 : 2});
    places += ranges_.back().count;
  }
  scale_of_field_.assign(joint_of_field_.size(), 1.0f);
  table_.assign(places, Eigen::Vector4f(0, 0, 0, 1));
}

void PoseRotations::read_twist(const Pose& pose, const TwistSource& source) {
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
    table_[source.first_place + step] = (near * turn).coeffs().cast<float>();
  }
}

void PoseRotations::read(const Pose& pose) {
  rigid_ = true;
  for (std::size_t field = 0; field < joint_of_field_.size(); ++field) {
    const int joint = joint_of_field_[field];
    scale_of_field_[field] = static_cast<float>(pose.scales[joint]);
    // Scales come out of cube roots: rounding alone must not make a rigid skeleton a growing one.
    constexpr double rounding = 1e-9;
    if (std::abs(pose.scales[joint] - 1.0) > rounding) rigid_ = false;
    if (twists_of_field_[field]) continue;
    const int place = place_of_field_[field];
    table_[place] = table_[place + 1] = pose.rotations[joint].coeffs().cast<float>();
  }
  for (const TwistSource& source : twists_) read_twist(pose, source);
}

void PoseRotations::append_terms(const int* fields, const float* weights, int count,
                                 std::vector<BlendTerm>& terms) const {
  for (int k = 0; k < count; ++k) {
    const int field = fields[k];
    if (!twists_of_field_[field]) {
      terms.push_back({place_of_field_[field], weights[k], 0.0f});
      continue;
    }
    // Both halves of a bone lie side by side; either may have been too weak to store.
    float near = far_end_of_field_[field] ? 0.0f : weights[k];
    float far = far_end_of_field_[field] ? weights[k] : 0.0f;
    if (!far_end_of_field_[field] && k + 1 < count && fields[k + 1] == field + 1 && far_end_of_field_[field + 1]) {
      far = weights[++k];
    }
    const float step = kTwistSteps * far / (near + far);
    const int below = std::min(static_cast<int>(step), kTwistSteps - 1);
    const float rest = step - static_cast<float>(below);
    terms.push_back({place_of_field_[field] + below, (near + far) * (1.0f - rest), (near + far) * rest});
  }
}

int PoseRotations::strongest_place(std::span<const BlendTerm> terms) {
  const auto strongest = std::max_element(terms.begin(), terms.end(), [](const BlendTerm& a, const BlendTerm& b) {
    return a.below + a.above < b.below + b.above;
  });
  return strongest->place;
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
