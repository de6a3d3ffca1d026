#pragma once

#include <array>
#include <cstddef>
#include <memory>

#include "pipeline/rig.h"
#include "skeleton/pose.h"

namespace sinew {

/// Where the first solve of a frame begins. A rig with a subspace of its free nodes uses that in place of
/// skinning where the choice is automatic.
enum class Start {
  automatic,  ///< whichever of previous, linear, quadratic and skinning is foretold to need the least work
  zero,       ///< nothing of earlier frames: every frame is solved from its pose alone
  previous,   ///< the frame before
  linear,     ///< extrapolated from the last two frames
  quadratic,  ///< extrapolated from the last three
  skinning,   ///< linear blend skinning with the harmonic weights, what it leaves extrapolated
  subspace,   ///< the rig's subspace of the free nodes, what it leaves extrapolated
  fischer     ///< the mixture of the last four frames that is nearest to the answer [Fischer 1998]
};

/// What a frame does with a rig. A rig is built for one form (binding_options()); a frame of the other
/// form on it is allowed and stands between the two.
struct FrameOptions {
  Deform deform = Deform::refined;
  /// Estimated largest error of any node, as a share of the rest box's diagonal. What a refined frame's
  /// earlier solves leave counts by what of it reaches the answer. Positions are kept in single precision:
  /// what lies below 1e-6 is not asked for.
  double tolerance = 1e-4;
  int max_cycles = 20;  ///< per solve; stopping here is an outcome (FrameReport::converged), not an exception
  Start start = Start::automatic;
  int local_global = 2;           ///< refined: iterations after the first solve
  double volume_gain = 0.7;       ///< refined: gamma of the volume scale, 0 switches it off
  bool measure_residual = false;  ///< one more pass over the edges after the last solve
};

enum class FrameStage { start, rotations, residual, solve, local, measure, count_ };
constexpr int kFrameStageCount = static_cast<int>(FrameStage::count_);
/// "start", "rotations", "residual", "solve", "local", "measure".
const char* stage_name(FrameStage stage);

/// What one frame took and how good it is.
struct FrameReport {
  int solves = 0;
  int cycles = 0;          ///< over all solves of the frame
  int full_cycles = 0;     ///< those of them of Reach::far: with multigrid, of full multigrid
  int whole_cycles = 0;    ///< corrections of Reach::whole: full multigrid and a V-cycle, two cycles each
  int light_cycles = 0;    ///< those of Reach::light: V-cycles with half the smoothing
  double error = 0.0;      ///< estimated largest error of any node, share of the diagonal
  double residual = 0.0;   ///< |b - A x| / |b| of the last solve, if measured
  bool converged = false;  ///< every solve reached the tolerance
  std::array<double, kFrameStageCount> milliseconds{};
};

/// Turns poses into positions, one after the other. Owns the scratch memory of one thread and the frames
/// before: solve() allocates nothing. The rig and the team are borrowed.
///
/// First pass: rotations blended from the harmonic fields. Second pass, [Shi et al. 2006, eq. 11]:
///
///     sum_j w(i,j) (x_i - x_j - d_ji) = 0,   d_ji = 1/2 (s_i R_i + s_j R_j) (x0_i - x0_j)
///
/// over the free nodes. Where the pose scales joints, s is the blend of their scales by the same harmonic
/// weights: the scalar Laplace problem of the paper has the same matrix and boundary, so it has the same
/// answer. Refined: after that solve, each iteration takes the rotation that fits each free node's
/// neighborhood best (rotations in bone cylinders stay), multiplies s by J^(-gamma/3), J the local volume
/// ratio, within 1/1.3 to 1.3 of the pose's scale, and solves again with the same matrix.
///
/// Each solve is iterative refinement: the left side of the equation, evaluated at the start edge by edge,
/// goes to the solver, and what comes back is added, until the estimated error is below the tolerance.
class FrameSolver {
 public:
  /// Throws std::invalid_argument when Start::subspace is asked of a rig without one.
  FrameSolver(const Rig& rig, const FrameOptions& options, ThreadTeam& team);
  ~FrameSolver();
  FrameSolver(FrameSolver&&) noexcept;

  /// Solves the next frame. Constrained nodes end exactly where the pose puts them. `pose` must be
  /// continuous with its neighbors in time (make_continuous()); the answer depends on `pose` and the
  /// poses since forget(), on nothing else. Throws std::invalid_argument for a pose of another skeleton.
  FrameReport solve(const Pose& pose);

  /// The next frame is solved as if it were the first.
  void forget();

  /// Positions of the first `positions.rows()` nodes: surface vertices come first.
  void read_positions(Eigen::Ref<Field3> positions) const;

  std::size_t bytes() const;

 private:
  struct Members;
  std::unique_ptr<Members> members_;
};

}  // namespace sinew
