#pragma once

#include <vector>

#include "pipeline/binding.h"
#include "pipeline/harmonic_fields.h"
#include "skeleton/pose.h"
#include "solver/thread_team.h"

namespace sinew {

/// What every field carries in one pose: a unit quaternion on a sign that is continuous in time, or,
/// for the two halves of a twisting bone, all rotations between the near end's and the far end's.
///
/// Near end: the bone's rotation without its own twist relative to its parent (a root has none). Far end: the bone's
/// rotation, and for a forearm the hand's twist about the forearm's axis on top. The twist angle comes
/// from quaternions whose sign is tracked (make_continuous()), so it runs through 180 degrees
/// without a jump. Between near and far the twist grows evenly; between bones quaternions are
/// blended and normalised.
class PoseRotations {
 public:
  PoseRotations(const RigSkeleton& skeleton, const Binding& binding);

  /// Reads a pose of the skeleton. Allocates nothing.
  void read(const Pose& pose);

  /// The rotation of a node that listens to `fields` with `weights`, `count` of both: unit.
  Eigen::Quaterniond blend(const int* fields, const float* weights, int count) const;

  /// The same mean of the bones' scales.
  double blend_scale(const int* fields, const float* weights, int count) const;

  /// Whether every scale is one, so that blend_scale() need not be asked.
  bool rigid() const { return rigid_; }

  /// The rotation a field carries at its own end: where its weight is one.
  Eigen::Quaterniond of_field(int field) const;

 private:
  struct FieldRotation {
    Eigen::Vector4d rotation;  ///< x y z w; of the near end where the bone twists
    double scale = 1.0;
    int twist = -1;            ///< index of the bone's twist table; -1: the bone does not twist
    bool far_end = false;
  };
  struct TwistSource {
    int joint = 0;
    int parent = -1;
    int twisted_by = -1;
    Eigen::Vector3d axis;
  };

  Eigen::Vector4d at_twist(int twist, double share) const;
  void read_twist(const Pose& pose, int twist);

  std::vector<int> joint_of_field_;
  std::vector<FieldRotation> fields_;
  std::vector<TwistSource> twists_;
  std::vector<Eigen::Vector4d> tables_;  ///< per twisting bone: rotations at even shares of its twist
  bool rigid_ = true;
};

/// One rotation and one scale per node for the current pose.
struct RotationField {
  std::vector<Eigen::Quaterniond> rotations;
  std::vector<double> scales;
};

/// Blends rotations and scales at every node. `out` keeps its memory between calls.
void blend_rotations(const HarmonicFields& fields, const PoseRotations& pose, ThreadTeam& team, RotationField& out);

/// Half the angle, radians, by which the unit quaternion `rotation` twists about the unit vector
/// `axis`: rotation = swing * twist with swing's real part >= 0. From -pi to pi, following the sign of
/// `rotation`: continuous through half a turn, up to a full one. A limb that swings right over has no
/// twist of its own and hardly any direction in which to measure one nearby, so the angle fades to zero as
/// the swing goes from 151 to 180 degrees.
double half_twist_about(const Eigen::Quaterniond& rotation, const Eigen::Vector3d& axis);

}  // namespace sinew
