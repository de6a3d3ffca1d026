#pragma once

#include <string>
#include <vector>

#include "tools/bench/solver_bench.h"
#include "tools/bench/table.h"

/// What `sinew bench solver` measured, for people and for programs.
namespace sinew {

/// A target's name, what it is held to, what it aims at, and what was measured.
struct Target {
  std::string name;
  double hold_to = 0.0;
  double aim = 0.0;
  bool at_least = true;      ///< else the measured value is to stay below
  double measured = 0.0;     ///< the worst of the systems
  std::string worst_system;  ///< where that was; empty: nothing measured
  std::string unit;          ///< " x", "", " %"

  bool met() const { return at_least ? measured >= hold_to : measured <= hold_to; }
};

/// The targets that the measured systems and solvers have numbers for, worst case over the systems.
std::vector<Target> solver_targets(const SolverBenchResult& result);

/// All tables: times and memory by system, settings, targets, and [Shi et al. 2006, tables 1 and 2] beside
/// the systems nearest in size.
std::vector<Table> solver_tables(const SolverBenchResult& result);

/// Processor, threads and measured read bandwidth, in one line.
std::string machine_line(const SolverBenchResult& result);

/// Table of targets: hold to, aim, measured.
Table target_table(const std::vector<Target>& targets);

/// Time to 1e-5, set-up and memory against size, a line a solver: medians where several systems have about
/// the same size. As SVG.
std::string solver_plot(const SolverBenchResult& result);

/// `systems[]` with `solvers.NAME`: setup_s, to_1e-3_s, to_1e-5_s, memory_mb, iterations and more.
std::string solver_json(const SolverBenchResult& result);

}  // namespace sinew
