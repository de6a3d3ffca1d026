#include "tools/bench/solver_report.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "tools/bench/statistics.h"
#include "tools/bench/svg_plot.h"

namespace sinew {
namespace {

using Json = nlohmann::ordered_json;

/// What [Shi et al. 2006] printed, Pentium 4 at 3.8 GHz: tables 1 and 2.
struct PaperRow {
  const char* mesh;
  int free_vertices;
  double cholmod_factor, cholmod_substitute, cholmod_mb;  // negative: out of memory
  double ml_setup, ml_loose, ml_tight, ml_mb;
  double own_setup, own_loose, own_tight, own_mb;
};
constexpr PaperRow kPaper[] = {
    {"SPRING", 24188, .43, .03, 26, .15, .36, .57, 15, .06, .13, .19, 10},
    {"DINO", 43494, .83, .05, 35, .34, .90, 2.19, 21, .16, .23, .39, 16},
    {"CAMEL", 99588, 5.48, .15, 139, .57, 3.36, 5.37, 52, .13, .41, .89, 31},
    {"FELINE", 181292, 12.20, .30, 292, 1.06, 5.94, 9.15, 87, .24, .66, 1.99, 56},
    {"FEMALE", 415619, 31.9, .78, 695, 2.63, 14.22, 24.00, 200, .58, 1.45, 4.19, 119},
    {"LUCY", 822204, 69.32, 1.36, 1311, 4.87, 27.63, 47.22, 388, .94, 2.41, 8.47, 232},
    {"DRAGON", 3447861, -1, -1, -1, 12.60, 85.86, 148.80, 1080, 2.64, 9.25, 39.70, 740},
};

/// A system this much larger or smaller than the paper's is another size.
constexpr double kSameSize = 1.35;

/// A factor's memory grows faster than a hierarchy's: their ratio is held to at this size and no other.
constexpr double kMemorySize = 500000;
constexpr double kMemorySizeRange = 0.2;

double seconds_to(const PeerResult* result, double tolerance) {
  const PeerSolve* solve = result != nullptr && result->finished() ? result->at(tolerance) : nullptr;
  return solve != nullptr && solve->reached ? solve->seconds : NAN;
}

std::string with_commas(std::int64_t number) {
  std::string text = std::to_string(number);
  for (int place = static_cast<int>(text.size()) - 3; place > 0; place -= 3) text.insert(place, ",");
  return text;
}

Table system_table(const SystemResult& system) {
  Table table{system.name + ", " + with_commas(system.free_vertices) + " free vertices, " +
                  with_commas(system.edges) + " edges",
              {"solver", "set-up s", "to 1e-3 s", "to 1e-5 s", "iterations", "memory MB", "peak MB",
               "error at 1e-3", "error at 1e-5"},
              {}};
  for (const auto& [name, result] : system.solvers) {
    if (!result.finished()) {
      std::vector<std::string> row = {name, "not finished"};
      row.resize(table.headings.size(), "-");
      table.rows.push_back(row);
      continue;
    }
    const PeerSolve* loose = result.at(kLooseTolerance);
    const PeerSolve* tight = result.at(kTightTolerance);
    table.rows.push_back({name, figure(result.setup_s), figure(seconds_to(&result, kLooseTolerance)),
                          figure(seconds_to(&result, kTightTolerance)),
                          std::to_string(loose->iterations) + " / " + std::to_string(tight->iterations),
                          figure(result.memory_mb), figure(result.peak_mb), error_figure(loose->vertex_error),
                          error_figure(tight->vertex_error)});
  }
  return table;
}

Table settings_table(const SolverBenchResult& result) {
  Table table{"Settings", {"solver", "settings"}, {}, 2};
  std::set<std::string> seen;
  for (const SystemResult& system : result.systems) {
    for (const auto& [name, peer] : system.solvers) {
      const std::string text = peer.finished() ? peer.settings : peer.failure;
      if (seen.insert(name + text).second) table.rows.push_back({name, text});
    }
  }
  return table;
}

Table paper_table(const SolverBenchResult& result) {
  Table table{
      "Tables 1 and 2 of Shi 2006 (Pentium 4, 3.8 GHz) beside the systems nearest in size: set-up / to 1e-3 "
      "/ "
      "to 1e-5 s, MB; CHOLMOD: factor / substitution s, MB",
      {"system", "free vertices", "CHOLMOD", "Trilinos ML", "Shi 2006", "sinew"},
      {}};
  const auto cell = [](double setup, double loose, double tight, double megabytes) {
    return figure(setup) + " / " + figure(loose) + " / " + figure(tight) + ", " + figure(megabytes);
  };
  const auto measured = [&](const PeerResult* peer) -> std::string {
    if (peer == nullptr || !peer->finished()) return "-";
    return cell(peer->setup_s, seconds_to(peer, kLooseTolerance), seconds_to(peer, kTightTolerance),
                peer->memory_mb);
  };
  for (const PaperRow& row : kPaper) {
    const SystemResult* nearest = nullptr;
    double least = std::log(kSameSize);
    for (const SystemResult& system : result.systems) {
      const double distance =
          std::abs(std::log(static_cast<double>(system.free_vertices) / row.free_vertices));
      if (distance > least) continue;
      least = distance;
      nearest = &system;
    }
    if (nearest == nullptr) continue;
    table.rows.push_back({row.mesh, with_commas(row.free_vertices),
                          row.cholmod_mb < 0
                              ? "over 2 GB"
                              : figure(row.cholmod_factor) + " / " + figure(row.cholmod_substitute) + ", " +
                                    figure(row.cholmod_mb),
                          cell(row.ml_setup, row.ml_loose, row.ml_tight, row.ml_mb),
                          cell(row.own_setup, row.own_loose, row.own_tight, row.own_mb), "-"});
    const PeerResult* cholmod = nearest->solver("cholmod");
    table.rows.push_back({nearest->name, with_commas(nearest->free_vertices),
                          cholmod == nullptr || !cholmod->finished()
                              ? "-"
                              : figure(cholmod->setup_s) + " / " +
                                    figure(seconds_to(cholmod, kTightTolerance)) + ", " +
                                    figure(cholmod->memory_mb),
                          measured(nearest->solver("trilinos_ml")), measured(nearest->solver("shi2006")),
                          measured(nearest->solver("sinew"))});
  }
  return table;
}

std::string system_label(const SystemResult& system) {
  return system.name + " " + with_commas(system.free_vertices);
}

/// Share of the measured read bandwidth that one cycle reaches, or not a number.
double cycle_share(const SystemResult& system, const std::string& cycle, double bandwidth) {
  const PeerResult* own = system.solver("sinew");
  if (own == nullptr || !own->finished()) return NAN;
  return own->figures.at(cycle + "_bytes") / own->figures.at(cycle + "_s") / bandwidth;
}

Table cycle_table(const SolverBenchResult& result) {
  Table table{"One cycle alone, three columns in single precision",
              {"system", "V-cycle ms", "MB moved", "of read bandwidth", "F-cycle ms", "MB moved",
               "of read bandwidth"},
              {}};
  for (const SystemResult& system : result.systems) {
    const PeerResult* own = system.solver("sinew");
    if (own == nullptr || !own->finished()) continue;
    std::vector<std::string> row = {system_label(system)};
    for (const std::string cycle : {"v_cycle", "f_cycle"}) {
      row.push_back(figure(1000.0 * own->figures.at(cycle + "_s")));
      row.push_back(figure(own->figures.at(cycle + "_bytes") / 1e6));
      row.push_back(figure(100.0 * cycle_share(system, cycle, result.read_bandwidth)) + " %");
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

/// The better of the two strongest packaged multigrids.
double best_peer_seconds(const SystemResult& system, double tolerance) {
  return std::fmin(seconds_to(system.solver("hypre"), tolerance),
                   seconds_to(system.solver("amgcl"), tolerance));
}

/// Takes the worst of `value` over the systems; values that are not numbers do not count.
template <typename Value>
void measure(Target& target, const SolverBenchResult& result, const Value& value) {
  for (const SystemResult& system : result.systems) {
    const double found = value(system);
    if (!std::isfinite(found)) continue;
    const bool worse = target.at_least ? found < target.measured : found > target.measured;
    if (!target.worst_system.empty() && !worse) continue;
    target.measured = found;
    target.worst_system = system_label(system);
  }
}

using SolverFigure = double (*)(const PeerResult&);

/// One line a solver: its figure against size. Systems within a quarter of a power of ten of each other are
/// one point, the medians of theirs.
std::vector<PlotLine> lines_by_solver(const SolverBenchResult& result, SolverFigure figure_of) {
  struct SizeClass {
    std::vector<double> sizes, figures;
  };
  std::map<std::string, std::map<long, SizeClass>> found;
  std::vector<PlotLine> lines;
  for (const SystemResult& system : result.systems) {
    for (const auto& [name, peer] : system.solvers) {
      if (!peer.finished()) continue;
      if (!found.contains(name)) lines.push_back({name, {}});
      SizeClass& size_class = found[name][std::lround(4.0 * std::log10(system.free_vertices))];
      size_class.sizes.push_back(system.free_vertices);
      size_class.figures.push_back(figure_of(peer));
    }
  }
  for (PlotLine& line : lines) {
    for (const auto& [place, size_class] : found[line.name]) {
      line.points.emplace_back(median(size_class.sizes), median(size_class.figures));
    }
  }
  return lines;
}

Json solver_record(const PeerResult& peer) {
  Json record;
  if (!peer.finished()) {
    record["failure"] = peer.failure;
    return record;
  }
  record["setup_s"] = peer.setup_s;
  record["to_1e-3_s"] = seconds_to(&peer, kLooseTolerance);  // not a number becomes null
  record["to_1e-5_s"] = seconds_to(&peer, kTightTolerance);
  record["memory_mb"] = peer.memory_mb;
  record["peak_mb"] = peer.peak_mb;
  record["solver_mb"] = peer.solver_mb;
  const PeerSolve* loose = peer.at(kLooseTolerance);
  const PeerSolve* tight = peer.at(kTightTolerance);
  record["iterations"] = {{"1e-3", loose->iterations}, {"1e-5", tight->iterations}};
  record["residual"] = {{"1e-3", loose->residual}, {"1e-5", tight->residual}};
  record["vertex_error"] = {{"1e-3", loose->vertex_error}, {"1e-5", tight->vertex_error}};
  for (const auto& [name, value] : peer.figures) record[name] = value;
  record["settings"] = peer.settings;
  return record;
}

}  // namespace

std::vector<Target> solver_targets(const SolverBenchResult& result) {
  const auto ratio_to_best = [](double tolerance) {
    return [tolerance](const SystemResult& system) {
      return best_peer_seconds(system, tolerance) / seconds_to(system.solver("sinew"), tolerance);
    };
  };
  const auto prepared = [](const PeerResult* peer) { return peer != nullptr && peer->finished(); };
  std::vector<Target> targets = {
      {"zero guess to 1e-3, times faster than the better of Hypre and AMGCL", 10, 15, true, 0, {}, " x"},
      {"zero guess to 1e-5, times faster than the better of Hypre and AMGCL", 6, 10, true, 0, {}, " x"},
      {"set-up, times faster than AMGCL's", 1, 2, true, 0, {}, " x"},
      {"memory of the hierarchy at 0.5M, share of CHOLMOD's factor", 1.0 / 15, 1.0 / 25, false, 0, {}, ""},
      {"F-cycles to 1e-3", 1, 1, false, 0, {}, ""},
      {"V-cycle, share of the measured read bandwidth", 70, 85, true, 0, {}, " %"},
  };
  measure(targets[0], result, ratio_to_best(kLooseTolerance));
  measure(targets[1], result, ratio_to_best(kTightTolerance));
  measure(targets[2], result, [&](const SystemResult& system) {
    const PeerResult *own = system.solver("sinew"), *amgcl = system.solver("amgcl");
    return prepared(own) && prepared(amgcl) ? amgcl->setup_s / own->setup_s : NAN;
  });
  measure(targets[3], result, [&](const SystemResult& system) {
    const PeerResult *own = system.solver("sinew"), *cholmod = system.solver("cholmod");
    const bool compared = std::abs(system.free_vertices / kMemorySize - 1.0) <= kMemorySizeRange;
    return compared && prepared(own) && prepared(cholmod) ? own->memory_mb / cholmod->memory_mb : NAN;
  });
  measure(targets[4], result, [&](const SystemResult& system) {
    const PeerResult* own = system.solver("sinew");
    return prepared(own) ? static_cast<double>(own->at(kLooseTolerance)->iterations) : NAN;
  });
  measure(targets[5], result, [&](const SystemResult& system) {
    return 100.0 * cycle_share(system, "v_cycle", result.read_bandwidth);
  });
  std::erase_if(targets, [](const Target& target) { return target.worst_system.empty(); });
  return targets;
}

Table target_table(const std::vector<Target>& targets) {
  Table table{"Targets, worst case", {"target", "hold to", "aim", "measured", "where", "met"}, {}};
  for (const Target& target : targets) {
    const std::string sign = target.at_least ? ">= " : "<= ";
    table.rows.push_back({target.name, sign + figure(target.hold_to) + target.unit,
                          sign + figure(target.aim) + target.unit, figure(target.measured) + target.unit,
                          target.worst_system, target.met() ? "yes" : "no"});
  }
  return table;
}

std::vector<Table> solver_tables(const SolverBenchResult& result) {
  std::vector<Table> tables;
  for (const SystemResult& system : result.systems) tables.push_back(system_table(system));
  if (result.systems.empty()) return tables;
  if (Table cycles = cycle_table(result); !cycles.rows.empty()) tables.push_back(std::move(cycles));
  tables.push_back(settings_table(result));
  if (Table paper = paper_table(result); !paper.rows.empty()) tables.push_back(std::move(paper));
  if (const auto targets = solver_targets(result); !targets.empty()) tables.push_back(target_table(targets));
  return tables;
}

std::string solver_plot(const SolverBenchResult& result) {
  const auto plot_of = [&](const std::string& title, const std::string& unit, SolverFigure figure_of) {
    return Plot{title, "free vertices", unit, lines_by_solver(result, figure_of)};
  };
  return svg_of(
      {plot_of("Zero guess to 1e-5", "seconds",
               [](const PeerResult& peer) { return seconds_to(&peer, kTightTolerance); }),
       plot_of("Set-up or factorisation", "seconds", [](const PeerResult& peer) { return peer.setup_s; }),
       plot_of("Memory", "MB", [](const PeerResult& peer) { return peer.memory_mb; })});
}

std::string machine_line(const SolverBenchResult& result) {
  return result.processor + ", " + std::to_string(result.threads) + " threads; read bandwidth " +
         figure(result.read_bandwidth / 1e9) + " GB/s, " + figure(result.one_thread_bandwidth / 1e9) +
         " GB/s on one thread. Three right-hand sides from a zero guess, true residuals in double, medians.";
}

std::string solver_json(const SolverBenchResult& result) {
  Json root;
  root["schema"] = "sinew.bench-solver/1";
  root["machine"] = {{"processor", result.processor}, {"threads", result.threads}};
  root["read_bandwidth_gbs"] = result.read_bandwidth / 1e9;
  root["one_thread_bandwidth_gbs"] = result.one_thread_bandwidth / 1e9;
  root["systems"] = Json::array();
  for (const SystemResult& system : result.systems) {
    Json record = {{"name", system.name},
                   {"free_vertices", system.free_vertices},
                   {"edges", system.edges},
                   {"build_s", system.build_s},
                   {"solvers", Json::object()}};
    for (const auto& [name, peer] : system.solvers) record["solvers"][name] = solver_record(peer);
    root["systems"].push_back(record);
  }
  root["skipped"] = result.skipped;
  root["targets"] = Json::array();
  for (const Target& target : solver_targets(result)) {
    root["targets"].push_back({{"name", target.name},
                               {"hold_to", target.hold_to},
                               {"aim", target.aim},
                               {"measured", target.measured},
                               {"where", target.worst_system},
                               {"met", target.met()}});
  }
  return root.dump(2) + '\n';
}

}  // namespace sinew
