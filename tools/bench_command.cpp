#include <algorithm>
#include <iostream>

#include "tools/bench/bench_files.h"
#include "tools/bench/solver_report.h"
#include "tools/commands.h"
#include "tools/interrupt.h"
#include "tools/progress.h"

namespace sinew {
namespace {

SceneFolders folders_of(const BenchOptions& options) {
  SceneFolders folders{options.data, options.rigs};
  if (folders.rigs.empty()) folders.rigs = built_in_rigs();
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
      std::cerr << "skipped: " << name << " (--data says where the meshes are)\n";
    }
  }
  return meshes;
}

void print(const std::vector<Table>& tables) {
  for (const Table& table : tables) std::cout << to_text(table) << '\n';
}

std::string markdown_of(const std::string& first_line, const std::vector<Table>& tables) {
  std::string text = first_line + "\n";
  for (const Table& table : tables) text += '\n' + to_markdown(table);
  return text;
}

}  // namespace

ExitCode run_bench_solver(const BenchSolverOptions& options) {
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
  if (!options.markdown.empty())
    write_markdown_section(options.markdown, "sinew bench solver", markdown_of(machine, tables));
  return ExitCode::ok;
}

}  // namespace sinew
