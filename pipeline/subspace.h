#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "skeleton/pose.h"
#include "solver/field.h"
#include "solver/large_pages.h"
#include "solver/thread_team.h"

namespace sinew {

class PoseRotations;
struct Rig;

/// Which nodes a subspace answers for.
enum class SubspaceOf {
  nothing,
  surface,    ///< the vertices of the mesh: what a preview shows
  free_nodes  ///< the nodes that are solved for: where frames start
};

/// Answers that are linear in the pose.
///
/// Were the rotation of every node the linear blend sum_k h_k R_k of the bones' matrices, the equation of the
/// second pass [Shi et al. 2006, eq. 11] would be linear in those matrices and in the positions of the
/// joints, and so would its answer be:
///
///     x_i = sum_k R_k g_k(i) + sum_c p_c g_c(i)
///
/// with three numbers a node and bone, g_k(i), and one a node and joint, g_c(i), which are solved for once:
/// the modes. A pose is answered by a sum over the modes, whatever came before it. It is off by what a linear
/// blend of matrices is off from a rotation, and knows nothing of the local steps of Deform::refined. Scaled
/// joints scale their matrices. A twisting bone has three matrices, at its near end, half way and at its far
/// end; between them twist is interpolated by a parabola.
///
/// A rest pose gives the rest body and a moved one the moved body, but for what is dropped: a mode counts
/// in a block of nodes where any of its numbers exceeds 2e-5 of the diagonal.
///
/// Positions are in the units of a frame's solve: relative to the pose's first joint, shares of the rest
/// box's diagonal. Immutable, shared by all frames.
class Subspace {
 public:
  /// Rows evaluated together.
  static constexpr int kBlock = 64;

  /// Solves the modes of a rig that is whole but for its subspace, and keeps a row for each node of
  /// `of`, in an order in which neighbors are near each other. Keeps no reference. Costs one solve a mode,
  /// eight at a time.
  Subspace(const Rig& rig, SubspaceOf of, ThreadTeam& team);

  /// The same modes for some of the rows of `all`, as those of no particular nodes.
  Subspace(const Subspace& all, std::span<const int> rows);

  /// SubspaceOf::nothing for some rows of another.
  SubspaceOf of() const { return of_; }

  int row_count() const { return row_count_; }
  int block_count() const { return (row_count_ + kBlock - 1) / kBlock; }
  int mode_count() const { return kPerMatrix * static_cast<int>(matrices_.size()) + joint_count_; }
  /// Three a mode.
  int coordinate_count() const { return 3 * mode_count(); }
  /// The node of each row; empty for some rows of another. Those of free_nodes are Rig::node_of_free.
  const std::vector<int>& nodes() const { return nodes_; }

  /// What a pose asks of the modes. `rotations` has read the pose; `coordinates` has coordinate_count()
  /// numbers. Allocates nothing.
  void read(const Pose& pose, const PoseRotations& rotations, Eigen::VectorXf& coordinates) const;

  /// The rows of block `block`, kBlock of them or what is left: positions and a zero. Linear in
  /// `coordinates`. Allocates nothing.
  void evaluate(int block, const Eigen::VectorXf& coordinates, Eigen::Vector4f* rows) const;

  std::size_t bytes() const;

 private:
  static constexpr int kPerMatrix = 3;

  /// One of the matrices R: of a turn of PoseRotations, or a joint's own, twist and all.
  struct Matrix {
    int joint = 0;
    int turn = -1;  ///< -1: the joint's own
    float along = 0.0f;
  };
  /// A mode's numbers in one block.
  struct alignas(64) Values {
    float of_row[kBlock] = {};
  };
  struct Entry {
    int block = 0;
    int mode = 0;
    Values values;
  };
  class Builder;

  void keep(const std::vector<Entry>& entries);

  SubspaceOf of_ = SubspaceOf::nothing;
  double diagonal_ = 1.0;
  int row_count_ = 0;
  int joint_count_ = 0;
  std::vector<int> nodes_;
  std::vector<Matrix> matrices_;
  std::vector<int> offsets_;  ///< block_count() + 1, into the two below
  std::vector<int> modes_;
  LargeVector<Values> values_;
};

}  // namespace sinew
