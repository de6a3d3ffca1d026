#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tools/exit_codes.h"

/// The program's verbs: each takes its resolved options and returns the exit code. Only files in
/// this folder print; they write results to standard output, everything else to standard error.
namespace sinew {

enum class Overwrite { ask, yes, no };
enum class ProgressStyle { automatic, bar, plain, json, none };

/// Options every verb shares.
struct CommonOptions {
  bool quiet = false;
  bool verbose = false;
  ProgressStyle progress = ProgressStyle::automatic;
};

struct InspectOptions {
  std::filesystem::path file;
  bool json = false;
};

struct AnimateCommandOptions {
  std::filesystem::path mesh;
  std::filesystem::path clip;  ///< empty: the mesh file's own animation
  std::filesystem::path output;
  std::filesystem::path rig;
  std::filesystem::path report;
  std::string animation;       ///< of a glTF clip: name or index; empty: the first
  std::string frames;
  double fps = 0.0;            ///< 0: the clip's own (glTF: 30)
  std::string interior = "lattice";
  double density = 0.0;
  double spacing = 0.0;
  std::string solver = "multigrid";
  std::string hierarchy = "lattice";
  std::string mode = "full";
  std::string deform = "refined";
  std::string format = "pca";
  double tolerance = 1e-4;
  std::string start = "auto";
  double gltf_tolerance = 1e-3;
  int threads = 0;
  bool in_place = false;
  Overwrite overwrite = Overwrite::ask;
  CommonOptions common;
};

/// What both benchmarks share.
struct BenchOptions {
  std::vector<std::string> meshes;  ///< empty: all that are there
  std::filesystem::path data;       ///< folder of the named meshes; empty: the sample alone
  std::filesystem::path samples;    ///< folder of the sample and the rig files; empty: where this was built from
  std::filesystem::path json;
  std::filesystem::path markdown;
  int threads = 0;
  double limit_seconds = 600.0;
  double limit_gigabytes = 20.0;
  CommonOptions common;
};

struct BenchSolverOptions : BenchOptions {
  std::vector<std::string> solvers;
  std::vector<int> sizes;
  std::filesystem::path plot;
  int repeats = 5;
  int rounds = 3;
};

struct BenchFramesOptions : BenchOptions {
  std::filesystem::path clip;  ///< empty: the sample's walk
  std::string frames;
  std::string deform = "refined";
  int size = 500000;
  double tolerance = 1e-4;
  std::string start = "auto";
  int repeats = 9;
  bool cholesky = true;
  bool check_errors = false;
  std::filesystem::path save;
  std::filesystem::path against;
  double max_slowdown = 1.15;
};

ExitCode run_inspect(const InspectOptions& options);
ExitCode run_animate(const AnimateCommandOptions& options);
ExitCode run_bench_solver(const BenchSolverOptions& options);
ExitCode run_bench_frames(const BenchFramesOptions& options);

}  // namespace sinew
