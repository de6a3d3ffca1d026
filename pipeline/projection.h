#pragma once

#include <array>
#include <span>
#include <vector>

#include "pipeline/frame_nodes.h"
#include "solver/thread_team.h"

/// Internal to pipeline/: the start that is nearest to the answer among mixtures of earlier answers.
namespace sinew {

/// One row per free slot: x, y, z and a zero, in the units of FrameNodes.
using SlotRows = LargeVector<Eigen::Vector4f>;

/// Projection on the last solutions [Fischer 1998]: of all mixtures of the last four answers whose weights
/// sum to one, the one that is nearest to the answer to come in the norm of the matrix A. x, y and z are
/// mixed each on its own.
///
/// Kept are the differences d of consecutive answers and their images A d, which one pass over the edges
/// works out from d itself: answers are only approximate, so the right-hand sides they belong to would not
/// do.
class Projection {
 public:
  Projection(const FrameNodes& nodes, ThreadTeam& team);

  void forget() { known_ = 0; }
  /// The difference newer - older takes the place of the oldest one.
  void add(const SlotRows& newer, const SlotRows& older);

  /// `start` is the newest answer, `residual` b - A start. Both become those of the nearest mixture.
  void improve(SlotRows& start, std::span<Eigen::Vector4f> residual);

  std::size_t bytes() const;

 private:
  static constexpr int kDifferences = 3;
  /// Of one column: products of differences with images, and of differences with the residual.
  struct Products {
    std::array<Eigen::Array4d, kDifferences * kDifferences> images;
    std::array<Eigen::Array4d, kDifferences> residual;
  };

  Eigen::Vector4f image_row(const SlotRows& rows, int slot) const;
  Products sum_products(std::span<const Eigen::Vector4f> residual);
  void solve_weights(const Products& products);

  const FrameNodes& nodes_;
  ThreadTeam& team_;
  std::array<SlotRows, kDifferences> differences_;
  std::array<SlotRows, kDifferences> images_;
  std::vector<Products> block_sums_;
  std::array<Eigen::Vector4f, kDifferences> weights_;
  int known_ = 0;
  int oldest_ = 0;
};

}  // namespace sinew
