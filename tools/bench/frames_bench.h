#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "io/report.h"
#include "pipeline/animate.h"
#include "tools/bench/error_check.h"
#include "tools/bench/peer_run.h"
#include "tools/bench/regression.h"
#include "tools/bench/scenes.h"

/// `sinew bench frames`: what a frame of a clip costs, stage by stage.
namespace sinew {

struct FramesBenchOptions {
  int size = 500000;  ///< free nodes wanted
  FrameOptions frame;
  int first_frame = 0;
  int last_frame = -1;
  int repeats = 9;       ///< runs over the frames; a frame's time is the median over them
  bool cholesky = true;  ///< also time one substitution of CHOLMOD on the same system
  bool check_errors = false;  ///< also solve every frame tightly and compare, which takes longer than the runs
  PeerLimits limits;
};

struct StageResult {
  std::string name;
  Spread milliseconds;  ///< over the frames
};

struct FramesBenchResult {
  std::string processor;
  int threads = 0;
  double read_bandwidth = 0.0;  ///< bytes a second
  std::string mesh, clip;
  std::string deform;
  int free_vertices = 0;
  int surface_vertices = 0;
  int first_frame = 0, frame_count = 0;
  std::int64_t rig_bytes = 0;
  std::vector<StageResult> stages;
  Spread frame;  ///< milliseconds of all stages together
  Spread cycles;
  Spread solves;
  int unconverged = 0;
  double error = 0.0;            ///< estimated largest error of any node in any frame, share of the diagonal
  double bytes_of_solves = 0.0;  ///< that the cycles of a frame read and write, median; 0 where not known
  std::optional<PeerResult> cholesky;  ///< on the system of the middle frame
  std::optional<ErrorCheckResult> errors;
  Baseline baseline;                   ///< settings, counters and samples of this run

  /// Milliseconds that the solves of a frame would take by substitution; 0 when not measured.
  double cholesky_milliseconds() const;
};

/// Runs the frames of `motion`, a motion of the scene's skeleton, several times over with a calibration
/// kernel in between. `tell` hears what is about to happen; when it returns false the run ends there with
/// what it has, and without samples. Throws std::runtime_error when two runs of the same frames count
/// differently.
FramesBenchResult run_frames_bench(const Scene& scene, const Motion& motion,
                                   const FramesBenchOptions& options,
                                   const std::function<bool(const std::string&)>& tell);

}  // namespace sinew
