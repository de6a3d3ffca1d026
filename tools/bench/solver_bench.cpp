#include "tools/bench/solver_bench.h"

#include <unistd.h>

#include <filesystem>

#include "io/report.h"
#include "samples/ogre_motion.h"
#include "skeleton/retarget.h"
#include "skeleton/unusable_input.h"
#include "tools/bench/bandwidth.h"
#include "tools/bench/posed_system.h"

namespace sinew {
namespace {

/// Of the sample walk: mid-stride, arms and legs apart.
constexpr int kFrame = 20;

/// A file that is gone when this is.
class TemporaryFile {
 public:
  TemporaryFile()
      : path_(std::filesystem::temp_directory_path() /
              ("sinew-bench-" + std::to_string(getpid()) + ".system")) {}
  ~TemporaryFile() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

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
  PeerLimits limits = options.limits;
  limits.threads = team.thread_count();
  SolverBenchResult result;
  result.threads = team.thread_count();
  result.processor = describe_machine(result.threads).processor;
  result.read_bandwidth = read_bandwidth(team);
  result.one_thread_bandwidth = read_bandwidth(one);
  const std::vector<std::string> solvers = options.solvers.empty() ? peers_at_hand() : options.solvers;
  const TemporaryFile file;
  for (const std::string& mesh : options.meshes) {
    for (const int size : options.sizes) {
      try {
        if (!tell(mesh + ", about " + std::to_string(size) + " free vertices: building")) return result;
        result.systems.push_back(prepare(load_scene(mesh, options.folders), size, team, file.path()));
      } catch (const UnusableInput& reason) {
        result.skipped.push_back(reason.what());
        continue;
      }
      SystemResult& system = result.systems.back();
      for (const std::string& solver : solvers) {
        if (!tell(mesh + ", " + std::to_string(system.free_vertices) + " free vertices: " + solver))
          return result;
        system.solvers.emplace_back(
            solver, run_peer(solver, file.path(), {kLooseTolerance, kTightTolerance}, limits));
      }
    }
  }
  return result;
}

}  // namespace sinew
