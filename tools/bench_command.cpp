#include <iostream>
#include <optional>
#include <stdexcept>

#include "io/bvh.h"
#include "io/file_error.h"
#include "samples/ogre_motion.h"
#include "skeleton/retarget.h"
#include "tools/bench/bench_files.h"
#include "tools/bench/frames_report.h"
#include "tools/bench/solver_report.h"
#include "tools/commands.h"
#include "tools/frame_range.h"
#include "tools/interrupt.h"
#include "tools/progress.h"
#include "tools/start_names.h"

namespace sinew {
namespace {

SceneFolders folders_of(const BenchOptions& options) {
  SceneFolders folders{options.data, options.samples};
  if (folders.samples.empty()) folders.samples = built_in_samples();
  return folders;
}

PeerLimits limits_of(const BenchOptions& options) {
  return {.threads = options.threads,
          .seconds = options.limit_seconds,
          .megabytes = options.limit_gigabytes * 1024.0};
}

/// The meshes asked for, or all whose files are there.
std::vector<std::string> meshes_of(const BenchOptions& options, const SceneFolders& folders) {
  if (!options.meshes.empty()) return options.meshes;
  std::vector<std::string> meshes;
  for (const std::string& name : scene_names()) {
    if (scene_exists(name, folders)) {
      meshes.push_back(name);
    } else if (!options.common.quiet) {
      std::cerr << "skipped: " << name << " (--data says where it is)\n";
    }
  }
  return meshes;
}

/// Refuses before any work what could only fail after it.
void check_outputs(std::initializer_list<std::filesystem::path> files) {
  for (const std::filesystem::path& file : files) {
    const std::filesystem::path folder = file.has_parent_path() ? file.parent_path() : ".";
    if (file.empty() || std::filesystem::is_directory(folder)) continue;
    throw FileError(FileFault::input_output, file.string(), "there is no folder " + folder.string());
  }
}

void print(const std::vector<Table>& tables) {
  for (const Table& table : tables) std::cout << to_text(table) << '\n';
}

std::string markdown_of(const std::string& first_line, const std::vector<Table>& tables) {
  std::string text = first_line + "\n";
  for (const Table& table : tables) text += '\n' + to_markdown(table);
  return text;
}

/// The frames asked for. Throws std::invalid_argument, one line for people.
FrameRange frames_of(const BenchFramesOptions& options, const Motion& motion) {
  if (options.frames.empty()) return {0, motion.frame_count() - 1, 1};
  const FrameRange range = resolve(parse_frame_range(options.frames), motion.frame_count());
  if (range.step != 1)
    throw std::invalid_argument("--frames: found '" + options.frames + "', expected no step here");
  return range;
}

Motion motion_of(const BenchFramesOptions& options, const Scene& scene) {
  Motion motion =
      retarget(options.clip.empty() ? samples::walk_clip() : read_bvh(options.clip), scene.skeleton);
  motion.name = options.clip.empty() ? "walk" : options.clip.stem().string();
  return motion;
}

std::optional<Baseline> baseline_of(const BenchFramesOptions& options) {
  if (options.against.empty()) return std::nullopt;
  return read_baseline(options.against);
}

ExitCode judge(const Baseline& before, const Baseline& now, double max_slowdown) {
  const Comparison comparison = compare(before, now, max_slowdown);
  for (const std::string& line : comparison_lines(comparison, max_slowdown)) std::cout << line << '\n';
  if (comparison.passed()) return ExitCode::ok;
  std::cerr << "error: slower than the baseline\n";
  return ExitCode::unusable_input;
}

}  // namespace

ExitCode run_bench_solver(const BenchSolverOptions& options) {
  check_outputs({options.json, options.markdown, options.plot});
  SolverBenchOptions bench;
  bench.folders = folders_of(options);
  bench.meshes = meshes_of(options, bench.folders);
  bench.sizes = options.sizes;
  bench.solvers = options.solvers;
  bench.limits = limits_of(options);
  bench.limits.repeats = options.repeats;
  bench.rounds = options.rounds;
  Progress progress(options.common.progress, options.common.quiet);
  const SolverBenchResult result = run_solver_bench(bench, [&](const std::string& line) {
    progress.stage(line);
    return interrupt_asked() == ExitCode::ok;
  });
  progress.finish();
  if (const ExitCode asked = interrupt_asked(); asked != ExitCode::ok) return asked;
  for (const std::string& reason : result.skipped) std::cerr << "skipped: " << reason << '\n';
  if (result.systems.empty()) {
    std::cerr << "error: no system could be built\n";
    return ExitCode::unusable_input;
  }
  const std::string machine = machine_line(result);
  const std::vector<Table> tables = solver_tables(result);
  std::cout << machine << "\n\n";
  print(tables);
  if (!options.json.empty()) write_text(options.json, solver_json(result));
  if (!options.plot.empty()) write_text(options.plot, solver_plot(result));
  if (!options.markdown.empty())
    write_markdown_section(options.markdown, "sinew bench solver", markdown_of(machine, tables));
  return ExitCode::ok;
}

ExitCode run_bench_frames(const BenchFramesOptions& options) {
  check_outputs({options.json, options.markdown, options.save});
  const std::optional<Baseline> before = baseline_of(options);
  const std::string mesh = options.meshes.empty() ? "ogre" : options.meshes.front();
  const Scene scene = load_scene(mesh, folders_of(options));
  const Motion motion = motion_of(options, scene);
  FramesBenchOptions bench;
  try {
    const FrameRange range = frames_of(options, motion);
    bench.first_frame = range.first;
    bench.last_frame = range.last;
  } catch (const std::invalid_argument& error) {
    std::cerr << "error: " << error.what() << '\n';
    return ExitCode::usage;
  }
  bench.size = options.size;
  bench.frame.deform = options.deform == "paper" ? Deform::paper : Deform::refined;
  bench.repeats = options.repeats;
  bench.frame.tolerance = options.tolerance;
  bench.frame.start = start_named(options.start);
  bench.cholesky = options.cholesky;
  bench.check_errors = options.check_errors;
  bench.limits = limits_of(options);
  Progress progress(options.common.progress, options.common.quiet);
  const FramesBenchResult result = run_frames_bench(scene, motion, bench, [&](const std::string& line) {
    progress.stage(line);
    return interrupt_asked() == ExitCode::ok;
  });
  progress.finish();
  if (const ExitCode asked = interrupt_asked(); asked != ExitCode::ok) return asked;
  const std::vector<Table> tables = frames_tables(result);
  std::cout << frames_line(result) << "\n\n";
  print(tables);
  if (!options.json.empty()) write_text(options.json, frames_json(result));
  if (!options.markdown.empty()) {
    write_markdown_section(
        options.markdown,
        "sinew bench frames " + mesh + " " + std::to_string(options.size) + " " + options.deform,
        markdown_of(frames_line(result), tables));
  }
  if (!options.save.empty()) write_baseline(options.save, result.baseline);
  return before ? judge(*before, result.baseline, options.max_slowdown) : ExitCode::ok;
}

}  // namespace sinew
