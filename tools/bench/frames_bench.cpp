#include "tools/bench/frames_bench.h"

#include <algorithm>
#include <numeric>
#include <sstream>
#include <stdexcept>

#include "tools/bench/bandwidth.h"
#include "tools/bench/bench_files.h"
#include "tools/bench/calibration.h"
#include "tools/bench/posed_system.h"

namespace sinew {
namespace {

/// What the runs over the frames found, frame by frame.
struct FrameLog {
  /// [stage][frame][repeat], milliseconds
  std::vector<std::vector<std::vector<double>>> stages;
  std::vector<std::vector<double>> whole;  ///< [frame][repeat]
  /// By frame, the same in every repeat.
  std::vector<double> cycles, full_cycles, whole_cycles, light_cycles, solves;
  int unconverged = 0;
  double error = 0.0;
};

/// Measuring the residual is no part of a frame's work.
bool is_work(int stage) {
  return static_cast<FrameStage>(stage) != FrameStage::measure;
}

class FrameRuns {
 public:
  FrameRuns(const Rig& rig, const Motion& motion, const FramesBenchOptions& options, ThreadTeam& team)
      : rig_(rig), motion_(motion), team_(team) {
    animate_.frame = options.frame;
    animate_.first_frame = options.first_frame;
    animate_.last_frame = options.last_frame;
    const int count = options.last_frame - options.first_frame + 1;
    log_.stages.assign(kFrameStageCount, std::vector<std::vector<double>>(count));
    log_.whole.resize(count);
  }

  /// Seconds that all stages of all frames took together.
  double run() {
    FrameLog& log = log_;
    const bool first = log.cycles.empty();
    double milliseconds = 0.0;
    animate(rig_, motion_, animate_, team_, [&](const FrameResult& result) {
      const auto frame = static_cast<std::size_t>(result.frame - animate_.first_frame);
      const FrameReport& report = result.report;
      double whole = 0.0;
      for (int stage = 0; stage < kFrameStageCount; ++stage) {
        log.stages[stage][frame].push_back(report.milliseconds[stage]);
        if (is_work(stage)) whole += report.milliseconds[stage];
      }
      log.whole[frame].push_back(whole);
      milliseconds += whole;
      if (first) {
        log.cycles.push_back(report.cycles);
        log.full_cycles.push_back(report.full_cycles);
        log.whole_cycles.push_back(report.whole_cycles);
        log.light_cycles.push_back(report.light_cycles);
        log.solves.push_back(report.solves);
        if (!report.converged) ++log.unconverged;
        log.error = std::max(log.error, report.error);
      } else if (log.cycles[frame] != report.cycles || log.solves[frame] != report.solves) {
        throw std::runtime_error("frame " + std::to_string(result.frame + 1) +
                                 " took another number of cycles the second time");
      }
      return true;
    });
    return milliseconds / 1000.0;
  }

  const FrameLog& log() const { return log_; }
  const AnimateOptions& settings() const { return animate_; }

 private:
  const Rig& rig_;
  const Motion& motion_;
  ThreadTeam& team_;
  AnimateOptions animate_;
  FrameLog log_;
};

/// Over the frames, of the median over the repeats.
Spread spread_over_frames(const std::vector<std::vector<double>>& repeats_by_frame) {
  std::vector<double> medians;
  for (const auto& repeats : repeats_by_frame) medians.push_back(median(repeats));
  return spread_of(std::move(medians));
}

void summarise(const FrameLog& log, FramesBenchResult& result) {
  for (int stage = 0; stage < kFrameStageCount; ++stage) {
    if (!is_work(stage)) continue;
    result.stages.push_back(
        {stage_name(static_cast<FrameStage>(stage)), spread_over_frames(log.stages[stage])});
  }
  result.frame = spread_over_frames(log.whole);
  result.cycles = spread_of(log.cycles);
  result.solves = spread_of(log.solves);
  result.unconverged = log.unconverged;
  result.error = log.error;
}

/// A frame's cycles alone, median.
double bytes_of_solves(const Rig& rig, const FrameLog& log) {
  const auto* multigrid = dynamic_cast<const MultigridSolver*>(rig.solver.get());
  if (multigrid == nullptr) return 0.0;
  const auto bytes_of = [&](Reach reach) {
    return static_cast<double>(multigrid->correction_cost(reach).bytes);
  };
  const double light = bytes_of(Reach::light), near = bytes_of(Reach::near), far = bytes_of(Reach::far),
               whole = bytes_of(Reach::whole);
  std::vector<double> bytes;
  for (std::size_t frame = 0; frame < log.cycles.size(); ++frame) {
    const double full = log.full_cycles[frame];
    const double both = log.whole_cycles[frame];
    const double few = log.light_cycles[frame];
    bytes.push_back(full * far + both * whole + few * light +
                    (log.cycles[frame] - full - 2 * both - few) * near);
  }
  return median(std::move(bytes));
}

std::string as_text(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::int64_t total(const std::vector<double>& counts) {
  return static_cast<std::int64_t>(std::accumulate(counts.begin(), counts.end(), 0.0));
}

void describe(const FrameLog& log, const FramesBenchOptions& options, FramesBenchResult& result) {
  Baseline& baseline = result.baseline;
  baseline.settings = {{"mesh", result.mesh},
                       {"clip", result.clip},
                       {"frames", std::to_string(result.first_frame + 1) + "-" +
                                      std::to_string(result.first_frame + result.frame_count)},
                       {"free vertices", std::to_string(result.free_vertices)},
                       {"deform", result.deform},
                       {"tolerance", as_text(options.frame.tolerance)},
                       {"threads", std::to_string(result.threads)}};
  baseline.counters = {{"cycles", total(log.cycles)},
                       {"solves", total(log.solves)},
                       {"unconverged frames", log.unconverged},
                       {"bytes of the rig", result.rig_bytes}};
}

PeerResult time_cholesky(const Rig& rig, const Motion& motion, const FramesBenchOptions& options,
                         ThreadTeam& team) {
  const TemporaryFile file(".system");
  const Pose& pose = motion.poses[(options.first_frame + options.last_frame) / 2];
  write_posed_system(file.path(), pose_system(rig, pose, "frame", team));
  return run_peer("cholmod", file.path(), {1e-5}, options.limits);
}

}  // namespace

double FramesBenchResult::cholesky_milliseconds() const {
  if (!cholesky || !cholesky->finished()) return 0.0;
  return 1000.0 * cholesky->solves.front().seconds * solves.median;
}

FramesBenchResult run_frames_bench(const Scene& scene, const Motion& motion, const FramesBenchOptions& given,
                                   const std::function<bool(const std::string&)>& tell) {
  ThreadTeam team(given.limits.threads);
  FramesBenchOptions options = given;
  options.limits.threads = team.thread_count();
  if (options.last_frame < 0) options.last_frame = motion.frame_count() - 1;
  FramesBenchResult result;
  result.threads = team.thread_count();
  result.processor = describe_machine(result.threads).processor;
  result.mesh = scene.name;
  result.clip = motion.name;
  result.deform = options.frame.deform == Deform::paper ? "paper" : "refined";
  result.first_frame = options.first_frame;
  result.frame_count = options.last_frame - options.first_frame + 1;
  if (!tell("building")) return result;
  const Rig rig = build_rig_of_size(scene, options.size, options.frame.deform, team,
                                    options.frame.start == Start::subspace ? SubspaceOf::free_nodes : SubspaceOf::nothing);
  result.free_vertices = static_cast<int>(rig.node_of_free.size());
  result.surface_vertices = rig.volume.surface_count;
  result.rig_bytes = static_cast<std::int64_t>(rig.bytes());

  FrameRuns runs(rig, motion, options, team);
  Calibration calibration(result.free_vertices, team);
  bool stopped = !tell("running the frames");
  std::vector<double> rates;  // between the runs: what the memory gives changes from minute to minute
  result.baseline.samples = normalised_samples(
      options.repeats,
      [&] {
        stopped = stopped || !tell("running the frames");
        if (stopped) return 0.0;
        rates.push_back(read_bandwidth(team));
        return runs.run();
      },
      [&] { return calibration.seconds(); });
  if (stopped) {
    result.baseline.samples.clear();
    return result;
  }
  result.read_bandwidth = median(rates);
  summarise(runs.log(), result);
  result.bytes_of_solves = bytes_of_solves(rig, runs.log());
  describe(runs.log(), options, result);
  if (options.check_errors && tell("solving every frame tightly"))
    result.errors = check_errors(rig, motion, runs.settings(), team);
  if (options.cholesky && tell("CHOLMOD")) result.cholesky = time_cholesky(rig, motion, options, team);
  return result;
}

}  // namespace sinew
