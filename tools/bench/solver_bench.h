#pragma once

#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tools/bench/peer_run.h"
#include "tools/bench/scenes.h"

/// `sinew bench solver`: one frame's system of named bodies in several sizes, solved by every solver there
/// is.
namespace sinew {

/// The two tolerances of every table.
inline constexpr double kLooseTolerance = 1e-3;
inline constexpr double kTightTolerance = 1e-5;

struct SolverBenchOptions {
  std::vector<std::string> meshes;   ///< of scene_names()
  std::vector<int> sizes;            ///< free nodes wanted
  std::vector<std::string> solvers;  ///< empty: all that are there
  SceneFolders folders;
  /// Every solver takes its turn this often, and medians are taken over the rounds: what else the machine
  /// does comes and goes over minutes. A solver that took long comes once.
  int rounds = 3;
  PeerLimits limits;
};

/// One system and what every solver took for it.
struct SystemResult {
  std::string name;
  int free_vertices = 0;
  std::int64_t edges = 0;
  double build_s = 0.0;  ///< volume graph, binding, fields: what comes before
  std::vector<std::pair<std::string, PeerResult>> solvers;  ///< in the order of the tables

  const PeerResult* solver(const std::string& solver_name) const;
};

struct SolverBenchResult {
  std::string processor;
  int threads = 0;
  double read_bandwidth = 0.0;        ///< bytes a second on all threads
  double one_thread_bandwidth = 0.0;  ///< on one
  std::vector<SystemResult> systems;
  std::vector<std::string> skipped;  ///< meshes and sizes that could not be had, and why
};

/// Runs it. `tell` hears what is about to happen, a line at a time; when it returns false the run ends there
/// with what it has.
SolverBenchResult run_solver_bench(const SolverBenchOptions& options,
                                   const std::function<bool(const std::string&)>& tell);

}  // namespace sinew
