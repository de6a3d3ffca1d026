#pragma once

#include <vector>

#include "pipeline/frame_nodes.h"
#include "pipeline/slot_blends.h"

/// Internal to pipeline/: linear blend skinning with what the slots listen to.
namespace sinew {

/// Linear blend skinning in the units of FrameNodes. It is linear in the coordinates of the pose, one 3 x 4
/// matrix for each bone that does not twist and three for each that does (kTwistKnots), so that what a
/// mixture of earlier poses leaves of the coordinates gives what it leaves of the skinned positions.
class SkinningBase {
 public:
  SkinningBase(const Rig& rig, const FrameNodes& nodes);

  int coordinate_count() const { return kPerMatrix * matrix_count_; }

  /// `rotations` has read the pose.
  void read(const Pose& pose, const PoseRotations& rotations, Eigen::VectorXf& coordinates) const;

  /// The first `count` nodes of a batch of `blends`; `rests` as in NodeRecord. Linear in `coordinates`.
  void evaluate(const SlotBlends& blends, int batch, int count, const Eigen::Vector4f* rests,
                const Eigen::VectorXf& coordinates, Eigen::Vector4f* positions) const;

 private:
  static constexpr int kPerMatrix = 12;

  const Rig& rig_;
  double diagonal_;
  Eigen::Vector3d center_;         // where the rest positions of the slots are zero
  std::vector<int> first_matrix_;  // by turn of PoseRotations
  int matrix_count_ = 0;
};

}  // namespace sinew
