#include "tools/bench/solver_bench.h"

#include <chrono>
#include <filesystem>

#include "io/report.h"
#include "samples/ogre_motion.h"
#include "skeleton/retarget.h"
#include "skeleton/unusable_input.h"
#include "tools/bench/bandwidth.h"
#include "tools/bench/bench_files.h"
#include "tools/bench/posed_system.h"
#include "tools/bench/statistics.h"

namespace sinew {
namespace {

/// Of the sample walk: mid-stride, arms and legs apart.
constexpr int kFrame = 20;

/// A solver that takes longer than this in a round is not asked again.
constexpr double kLongSeconds = 25.0;

/// Builds the system and leaves it in `file` alone: the solvers may need all the memory there is.
SystemResult prepare(const Scene& scene, int size, ThreadTeam& team, const std::filesystem::path& file) {
  const Motion motion = retarget(samples::walk_clip(), scene.skeleton);
  const Rig rig = build_rig_of_size(scene, size, Deform::paper, team);
  const PosedSystem posed = pose_system(rig, motion.poses[kFrame], scene.name, team);
  write_posed_system(file, posed);
  SystemResult result;
  result.name = scene.name;
  result.free_vertices = posed.size();
  result.edges = posed.system.graph.edge_count();
  result.build_s = rig.timing.total() / 1000.0;
  return result;
}

/// All solvers on the system in `file`. False when `tell` says to stop.
bool take_turns(const SolverBenchOptions& options, const std::filesystem::path& file, SystemResult& system,
                const std::function<bool(const std::string&)>& tell) {
  std::vector<std::vector<PeerResult>> rounds(options.solvers.size());
  std::vector<bool> again(options.solvers.size(), true);
  for (int round = 0; round < options.rounds; ++round) {
    for (std::size_t k = 0; k < options.solvers.size(); ++k) {
      if (!again[k]) continue;
      const std::string& solver = options.solvers[k];
      if (!tell(system.name + ", " + std::to_string(system.free_vertices) + " free vertices: " + solver))
        return false;
      const auto start = std::chrono::steady_clock::now();
      rounds[k].push_back(run_peer(solver, file, {kLooseTolerance, kTightTolerance}, options.limits));
      const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
      again[k] = took.count() < kLongSeconds && rounds[k].back().finished();
    }
  }
  for (std::size_t k = 0; k < options.solvers.size(); ++k) {
    system.solvers.emplace_back(options.solvers[k], median_of(rounds[k]));
  }
  return true;
}

}  // namespace

const PeerResult* SystemResult::solver(const std::string& solver_name) const {
  for (const auto& [own_name, result] : solvers) {
    if (own_name == solver_name) return &result;
  }
  return nullptr;
}

SolverBenchResult run_solver_bench(const SolverBenchOptions& options,
                                   const std::function<bool(const std::string&)>& tell) {
  ThreadTeam team(options.limits.threads);
  ThreadTeam one(1);
  SolverBenchOptions resolved = options;
  resolved.limits.threads = team.thread_count();
  if (resolved.solvers.empty()) resolved.solvers = peers_at_hand();
  SolverBenchResult result;
  result.threads = team.thread_count();
  result.processor = describe_machine(result.threads).processor;
  std::vector<double> rates;  // after every system: what the memory gives changes from minute to minute
  std::vector<double> one_thread_rates;
  const TemporaryFile file(".system");
  for (const std::string& mesh : options.meshes) {
    for (const int size : options.sizes) {
      try {
        if (!tell(mesh + ", about " + std::to_string(size) + " free vertices: building")) return result;
        result.systems.push_back(prepare(load_scene(mesh, options.folders), size, team, file.path()));
      } catch (const UnusableInput& reason) {
        result.skipped.push_back(reason.what());
        continue;
      }
      if (!take_turns(resolved, file.path(), result.systems.back(), tell)) return result;
      rates.push_back(read_bandwidth(team));
      one_thread_rates.push_back(read_bandwidth(one));
      result.read_bandwidth = median(rates);
      result.one_thread_bandwidth = median(one_thread_rates);
    }
  }
  return result;
}

}  // namespace sinew
