#pragma once

#include <span>
#include <vector>

#include "pipeline/binding.h"
#include "pipeline/harmonic_fields.h"
#include "skeleton/pose.h"
#include "solver/thread_team.h"

namespace sinew {

/// A node's share in one bone's rotation, worked out once for a rig: `below` times the rotation at
/// `place` plus `above` times the one after it.
struct BlendTerm {
  int place = 0;
  float below = 0.0f;
  float above = 0.0f;
};

/// Places of BlendTerm that belong to one bone: two alike for an undivided bone, or even steps of the twist
/// from its near end to its far end.
struct PlaceRange {
  int joint = 0;  ///< they turn about
  int first = 0;
  int count = 0;
};

/// What every field carries in one pose: a unit quaternion on a sign that is continuous in time, or,
/// for the two halves of a twisting bone, all rotations between the near end's and the far end's.
///
/// Near end: the bone's rotation without its own twist relative to its parent (a root has none). Far end: the
/// bone's rotation, and for a forearm the hand's twist about the forearm's axis on top. The twist angle comes
/// from quaternions whose sign is tracked (make_continuous()), so it runs through 180 degrees
/// without a jump. Between near and far the twist grows evenly; between bones quaternions are
/// blended and normalised.
class PoseRotations {
 public:
  PoseRotations(const RigSkeleton& skeleton, const Binding& binding);

  /// Reads a pose of the skeleton. Allocates nothing.
  void read(const Pose& pose);

  /// Appends the terms of a node that listens to `fields` with `weights`, `count` of both. They hold for
  /// every pose.
  void append_terms(const int* fields, const float* weights, int count, std::vector<BlendTerm>& terms) const;

  /// The rotation of a node with these terms, a quaternion x y z w of any length from 1e-4 on.
  Eigen::Vector4f blend_of_any_length(std::span<const BlendTerm> terms) const {
    Eigen::Vector4f sum = Eigen::Vector4f::Zero();
    for (const BlendTerm& term : terms)
      sum += term.below * table_[term.place] + term.above * table_[term.place + 1];
    constexpr float least = 1e-8f;  // opposite bones cancel: no mean exists, the strongest bone decides
    if (sum.squaredNorm() < least) return table_[strongest_place(terms)];
    return sum;
  }
  /// The same, unit to single precision like the weights.
  Eigen::Quaternionf blend(std::span<const BlendTerm> terms) const {
    return Eigen::Quaternionf(blend_of_any_length(terms).normalized());
  }

  /// The mean of the bones' scales with a node's weights.
  float blend_scale(const int* fields, const float* weights, int count) const;

  /// The places, bone after bone, and the unit quaternion x y z w at each of them in the pose read.
  std::span<const PlaceRange> ranges() const { return ranges_; }
  std::span<const Eigen::Vector4f> table() const { return table_; }

  /// The rotation at a place in the pose read.
  Eigen::Matrix3d matrix_at(int place) const {
    return Eigen::Quaternionf(table_[place]).cast<double>().normalized().toRotationMatrix();
  }

  /// Whether every scale is one, so that blend_scale() need not be asked.
  bool rigid() const { return rigid_; }

 private:
  struct TwistSource {
    int joint = 0;
    int parent = -1;
    int twisted_by = -1;
    Eigen::Vector3d axis;
    int first_place = 0;
  };

  static int strongest_place(std::span<const BlendTerm> terms);
  void read_twist(const Pose& pose, const TwistSource& source);

  std::vector<int> joint_of_field_;
  std::vector<int> place_of_field_;  ///< of its rotation; of the near end's where the bone twists
  std::vector<bool> far_end_of_field_;
  std::vector<bool> twists_of_field_;
  std::vector<float> scale_of_field_;
  std::vector<TwistSource> twists_;
  std::vector<PlaceRange> ranges_;
  /// Quaternions x y z w: one for an undivided bone and its copy, or a twisting bone's at even steps of
  /// its twist.
  std::vector<Eigen::Vector4f> table_;
  bool rigid_ = true;
};

/// One rotation and one scale per node for the current pose.
struct RotationField {
  std::vector<Eigen::Quaternionf> rotations;
  std::vector<float> scales;
};

/// Blends rotations and scales at every node. `out` keeps its memory between calls.
void blend_rotations(const HarmonicFields& fields, const PoseRotations& pose, ThreadTeam& team,
                     RotationField& out);

/// Half the angle, radians, by which the unit quaternion `rotation` twists about the unit vector
/// `axis`: rotation = swing * twist with swing's real part >= 0. From -pi to pi, following the sign of
/// `rotation`: continuous through half a turn, up to a full one. A limb that swings right over has no
/// twist of its own and hardly any direction in which to measure one nearby, so the angle fades to zero as
/// the swing goes from 151 to 180 degrees.
double half_twist_about(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& axis);

}  // namespace sinew
