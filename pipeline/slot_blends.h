#pragma once

#include <cstddef>
#include <span>

#include "pipeline/harmonic_fields.h"
#include "pipeline/local_step.h"
#include "pipeline/rotation_field.h"
#include "solver/large_pages.h"

/// Internal to pipeline/: what the nodes of a frame listen to, as its passes over them read it.
namespace sinew {

/// The terms of PoseRotations of a list of nodes, kFitLanes nodes side by side: a batch. What any node of a
/// batch listens to has a number for all of them. Neighbors listen to the same bones, so that this takes less
/// memory than each node's own terms, and is summed up without looking anything up node by node.
class SlotBlends {
 public:
  using Lanes = Wide<float, kFitLanes>;

  /// Batch k holds nodes[k kFitLanes] and those behind it; lanes without a node have no terms.
  SlotBlends(const HarmonicFields& fields, std::span<const int> nodes, const PoseRotations& rotations);

  /// The rotations of a batch, as PoseRotations::blend() to single precision but for their lengths, from
  /// PoseRotations::kLeastLength on: quaternions x y z w, number by number. No turn in lanes without a node.
  void blend(int batch, const PoseRotations& rotations, float (&quaternions)[4][kFitLanes]) const;

  /// Calls undivided(turn, weights) and twisting(turn, weights, along) for the bones that a batch listens to;
  /// lanes that do not have the weight zero.
  template <typename Undivided, typename Twisting>
  void for_each_turn(int batch, const Undivided& undivided, const Twisting& twisting) const {
    for (int k = undivided_.offsets[batch]; k < undivided_.offsets[batch + 1]; ++k)
      undivided(undivided_.turns[k], undivided_.row(k));
    for (int k = twisting_.offsets[batch]; k < twisting_.offsets[batch + 1]; ++k)
      twisting(twisting_.turns[k], twisting_.row(2 * k), twisting_.row(2 * k + 1));
  }

  std::size_t bytes() const;

 private:
  struct Entries {
    LargeVector<int> offsets = {0};  // by batch
    LargeVector<int> turns;
    LargeVector<float> rows;  // kFitLanes each: an entry's weights, and where it twists, places along

    Lanes row(int k) const { return loaded<Lanes>(&rows[static_cast<std::size_t>(k) * kFitLanes]); }
  };

  void append_batch(const HarmonicFields& fields, std::span<const int> nodes, const PoseRotations& rotations);
  Eigen::Vector4f strongest(int batch, int lane, const PoseRotations& rotations) const;

  Entries undivided_;
  Entries twisting_;
};

}  // namespace sinew
