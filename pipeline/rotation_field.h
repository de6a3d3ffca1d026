#pragma once

#include <array>
#include <span>
#include <vector>

#include "pipeline/binding.h"
#include "pipeline/harmonic_fields.h"
#include "skeleton/pose.h"
#include "solver/thread_team.h"

namespace sinew {

/// A node's share in the rotations of one bone, worked out once for a rig.
struct BlendTerm {
  int turn = 0;  ///< of PoseRotations::turns()
  float weight = 0.0f;
  float along = 0.0f;  ///< where the node is on a twisting bone: 0 near end, 1 far end; 0 on an undivided one
};

/// The rotations of one bone in one pose. With a = half_twist (along - 1/2) the one at `along` is the unit
/// quaternion x y z w
///
///     middle cos a + across sin a,
///
/// `across` being the middle one turned on by half a turn about the bone's axis; zero for undivided bones, as
/// is half_twist.
struct BoneTurn {
  int joint = 0;  ///< it turns about
  bool twists = false;
  float half_twist = 0.0f;  ///< half the angle, radians, from the near end to the far end, within two pi
  Eigen::Vector4f middle = {0.0f, 0.0f, 0.0f, 1.0f};
  Eigen::Vector4f across = Eigen::Vector4f::Zero();

  Eigen::Vector4f at(float along) const;
};

/// Places along a twisting bone whose rotations stand for the others where a blend must be linear in them,
/// and the parabolas that are one at their knot and zero at the others.
constexpr std::array<float, 3> kTwistKnots = {0.0f, 0.5f, 1.0f};
template <typename Number>
inline std::array<Number, 3> twist_parabolas(const Number& along) {
  return {2.0f * (along - 0.5f) * (along - 1.0f), 4.0f * along * (1.0f - along),
          2.0f * along * (along - 0.5f)};
}

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

  /// The rotation of a node with these terms, a unit quaternion to single precision like the weights. Where
  /// opposite bones cancel, to less than kLeastLength, no mean exists: the strongest bone decides.
  Eigen::Quaternionf blend(std::span<const BlendTerm> terms) const;

  static constexpr float kLeastLength = 1e-4f;

  /// The mean of the bones' scales with a node's weights.
  float blend_scale(const int* fields, const float* weights, int count) const;

  /// Bone after bone, in the pose read.
  std::span<const BoneTurn> turns() const { return turns_; }

  /// The rotation of a bone at a place along its twist, in the pose read.
  Eigen::Matrix3d matrix_at(int turn, float along) const {
    return Eigen::Quaternionf(turns_[turn].at(along)).cast<double>().normalized().toRotationMatrix();
  }

  /// Whether every scale is one, so that blend_scale() need not be asked.
  bool rigid() const { return rigid_; }

 private:
  /// Of a twisting bone.
  struct TwistSource {
    int turn = 0;
    int parent = -1;
    int twisted_by = -1;
    Eigen::Vector3d axis;
  };

  void read_twist(const Pose& pose, const TwistSource& source);

  std::vector<int> turn_of_field_;
  std::vector<bool> far_end_of_field_;
  std::vector<float> scale_of_field_;
  std::vector<TwistSource> twists_;
  std::vector<BoneTurn> turns_;
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
