#pragma once

#include <array>
#include <memory>

#include "pipeline/rig.h"
#include "skeleton/pose.h"

namespace sinew {

/// How bone motion becomes body shape (QUALITY: the two settings compared).
enum class Deform {
  refined,  ///< thin cores, twist fields, two local/global iterations, accumulated volume scale
  paper,    ///< Shi 2006 section 7 as published
};

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
class FrameSolver {
 public:
  FrameSolver(const Rig& rig, const FrameOptions& options, ThreadTeam& team);
  ~FrameSolver();
  FrameSolver(FrameSolver&&) noexcept;

  /// `positions`: node_count x 3, the first guess on entry and the answer on return. Constrained
  /// nodes end exactly where the pose puts them. `pose` must be continuous with its neighbours in
  /// time (make_continuous()); the answer depends on `pose` and on the guess, on nothing else.
  FrameReport solve(const Pose& pose, Field3& positions);

 private:
  struct Members;
  std::unique_ptr<Members> members_;
};

}  // namespace sinew
