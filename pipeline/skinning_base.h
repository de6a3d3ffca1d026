#pragma once

#include <span>
#include <vector>

#include "pipeline/frame_nodes.h"
#include "pipeline/rotation_field.h"

/// Internal to pipeline/: what the slots listen to, and linear blend skinning with it.
namespace sinew {

/// What every slot listens to: the terms of PoseRotations, slot after slot.
struct SlotTerms {
  SlotTerms(const Rig& rig, const FrameNodes& nodes, const PoseRotations& rotations);
  /// Those of some slots, side by side in memory.
  SlotTerms(const SlotTerms& all, std::span<const int> slots);

  std::span<const BlendTerm> of(int slot) const {
    return {&terms[offsets[slot]], static_cast<std::size_t>(offsets[slot + 1] - offsets[slot])};
  }

  LargeVector<int> offsets;  ///< slot_count + 1
  LargeVector<BlendTerm> terms;
};

/// Linear blend skinning in the units of FrameNodes. It is linear in the coordinates of the pose, one 4 x 4
/// matrix a place of PoseRotations, so that what a mixture of earlier poses leaves of the coordinates gives
/// what it leaves of the skinned positions.
class SkinningBase {
 public:
  SkinningBase(const Rig& rig, const FrameNodes& nodes);

  int coordinate_count() const { return kPerPlace * place_count_; }

  /// `rotations` has read the pose.
  void read(const Pose& pose, const PoseRotations& rotations, Eigen::VectorXf& coordinates) const;

  /// A node that listens to `terms`; `rest` as in NodeRecord.
  static Eigen::Vector4f at(std::span<const BlendTerm> terms, const Eigen::Vector4f& rest,
                            const Eigen::VectorXf& coordinates);

 private:
  static constexpr int kPerPlace = 16;

  const Rig& rig_;
  double diagonal_;
  Eigen::Vector3d center_;  // where the rest positions of the slots are zero
  int place_count_ = 0;
};

}  // namespace sinew
