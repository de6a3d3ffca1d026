#pragma once

#include <functional>
#include <vector>

#include "pipeline/frame_solver.h"
#include "skeleton/retarget.h"

/// The method, and the folder's front door: how moving bones become a moving mesh.
///
/// Once per mesh and skeleton: volume_graph.h fills the body with nodes; binding.h decides which
/// nodes each bone turns and which each joint holds; harmonic_fields.h spreads every bone's say over
/// the body; rig.h gathers it and prepares the solver. Once per frame: frame_solver.h blends the
/// rotations, builds the right-hand side and solves for the coordinates. Here: clips of frames.
/// Nothing in this folder opens a file or prints.
namespace sinew {

/// How frames are answered.
enum class FrameMode {
  full,    ///< solved, to the tolerance
  preview  ///< from the rig's subspace of the surface alone (preview.h): nothing is solved
};

struct AnimateOptions {
  FrameMode mode = FrameMode::full;
  FrameOptions frame = {};  ///< of FrameMode::full
  int first_frame = 0;      ///< of the motion, 0-based
  int last_frame = -1;      ///< inclusive; -1: the last one
  /// Frames are solved in chunks whose starts are multiples of this many frames of the *motion*; a
  /// chunk starts from nothing, each later frame from the ones before. So a frame's bytes
  /// depend on this number and on the motion, not on threads or on first_frame.
  int chunk = 128;
};

/// One finished frame, handed out in order.
struct FrameResult {
  int frame = 0;                        ///< of the motion
  const Field3* positions = nullptr;    ///< vertex_count x 3, in the order of Rig::mesh
  FrameReport report;                   ///< of a preview: its time, as FrameStage::start, and no solves
  double volume_ratio = 1.0;            ///< enclosed volume over the rest one
  double farthest_from_skeleton = 0.0;  ///< of any vertex, as a share of the rest body's height
};

/// Solves or previews the frames and calls `sink` for each, in order, from the calling thread. A sink that
/// returns false stops the run. Throws UnusableInput naming the frame when a pose is not finite, and
/// std::invalid_argument for frames beyond the motion and for previews of a rig without a subspace of its surface.
void animate(const Rig& rig, const Motion& motion, const AnimateOptions& options, ThreadTeam& team,
             const std::function<bool(const FrameResult&)>& sink);

}  // namespace sinew
