#pragma once

#include <vector>

#include "pipeline/frame_solver.h"
#include "pipeline/rig.h"
#include "pipeline/rotation_field.h"
#include "skeleton/retarget.h"

namespace sinew {

/// Frames from a rig's subspace of the surface alone: no frame needs another, and none is solved. What that
/// costs in accuracy, measure_preview() measures. Owns the scratch memory of one thread; the rig and the team
/// are borrowed.
class Preview {
 public:
  /// Throws std::invalid_argument when the rig has no subspace of its surface.
  Preview(const Rig& rig, ThreadTeam& team);

  /// Positions of the surface vertices, in the mesh's order. Allocates nothing. Throws std::invalid_argument
  /// for a pose of another skeleton or another number of rows. Linear in vertices times modes.
  void answer(const Pose& pose, Eigen::Ref<Field3> positions);

 private:
  const Rig& rig_;
  const Subspace& subspace_;
  ThreadTeam& team_;
  double diagonal_;
  PoseRotations rotations_;
  Eigen::VectorXf coordinates_;
};

/// How far previews are from solved frames, over the surface vertices, as shares of the diagonal.
struct PreviewError {
  std::vector<int> frames;  ///< measured, of the motion
  double largest = 0.0;     ///< distance of any vertex in any of them
  int worst_frame = 0;      ///< where that is
  double rms = 0.0;         ///< over all vertices and those frames
};

/// Compares frames spread evenly over [first_frame, last_frame], at most `count`, with the frames that a
/// FrameSolver with these options makes of them, each on its own. Costs as many solves from nothing.
PreviewError measure_preview(const Rig& rig, const Motion& motion, int first_frame, int last_frame, int count,
                             const FrameOptions& options, ThreadTeam& team);

}  // namespace sinew
