#pragma once

#include <array>
#include <memory>

#include "pipeline/rig.h"
#include "skeleton/pose.h"

namespace sinew {

/// What a frame does with a rig. A rig is built for one form (binding_options()); a frame of the other
/// form on it is allowed and stands between the two.
struct FrameOptions {
  Deform deform = Deform::refined;
  SolveOptions solve;          ///< tolerance of each solve
  int local_global = 2;        ///< refined: iterations after the first solve
  double volume_gain = 0.7;    ///< refined: gamma of the volume scale, 0 switches it off
};

enum class FrameStage { rotations, right_hand_side, solve, local, count_ };
constexpr int kFrameStageCount = static_cast<int>(FrameStage::count_);
/// "rotations", "right_hand_side", "solve", "local".
const char* stage_name(FrameStage stage);

/// What one frame took and how good it is.
struct FrameReport {
  int solves = 0;
  int cycles = 0;          ///< over all solves of the frame
  double residual = 0.0;   ///< of the last solve
  bool converged = false;  ///< every solve reached its tolerance
  std::array<double, kFrameStageCount> milliseconds{};
};

/// Turns a pose into positions. Owns the scratch memory of one thread: solve() allocates nothing.
/// The rig and the team are borrowed.
///
/// First pass: rotations blended from the harmonic fields. Second pass, [Shi et al. 2006, eq. 11]:
///
///     sum_j w(i,j) (x_i - x_j - d_ji) = 0,   d_ji = 1/2 (s_i R_i + s_j R_j) (x0_i - x0_j)
///
/// over the free nodes, constrained ones moved to the left side. Where the pose scales joints, s is
/// the blend of their scales by the same harmonic weights: the scalar Laplace problem of the paper
/// has the same matrix and boundary, so it has the same answer. Refined: after that solve, each
/// iteration takes the rotation that fits each free node's neighborhood best (rotations in bone
/// cylinders stay), multiplies s by J^(-gamma/3), J the local volume ratio, within 1/1.3 to 1.3 of the
/// pose's scale, and solves again with the same matrix.
///
/// Positions are taken relative to the skeleton's first joint, so residuals do not depend on where the
/// body stands.
class FrameSolver {
 public:
  FrameSolver(const Rig& rig, const FrameOptions& options, ThreadTeam& team);
  ~FrameSolver();
  FrameSolver(FrameSolver&&) noexcept;

  /// `positions`: node_count x 3, the first guess on entry and the answer on return. Constrained
  /// nodes end exactly where the pose puts them. `pose` must be continuous with its neighbours in
  /// time (make_continuous()); the answer depends on `pose` and on the guess, on nothing else.
  FrameReport solve(const Pose& pose, Field3& positions);

  /// The same without a guess: the first solve starts from zero with full multigrid, so the answer
  /// depends on `pose` alone.
  FrameReport solve_afresh(const Pose& pose, Field3& positions);

 private:
  struct Members;
  std::unique_ptr<Members> members_;
};

}  // namespace sinew
