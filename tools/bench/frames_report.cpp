#include "tools/bench/frames_report.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace sinew {
namespace {

using Json = nlohmann::ordered_json;

/// Targets in milliseconds hold where this much can be read a second, and in proportion elsewhere.
constexpr double kTargetBandwidth = 36e9;

/// The sizes that targets are stated for, and how far from them they count.
struct FrameTarget {
  int free_vertices;
  double paper_ms, refined_ms;
};
constexpr FrameTarget kFrameTargets[] = {{100000, 7.0, 18.0}, {500000, 35.0, 90.0}};
constexpr double kSizeRange = 0.2;

const std::string kStart = stage_name(FrameStage::start);
const std::string kSolve = stage_name(FrameStage::solve);
const std::string kResidual = stage_name(FrameStage::residual);

std::vector<std::string> spread_row(const std::string& name, const Spread& spread) {
  return {name, figure(spread.median), figure(spread.p95), figure(spread.p99), figure(spread.max)};
}

double share_of_bandwidth(const FramesBenchResult& result, double bytes, double milliseconds) {
  return bytes / (milliseconds / 1000.0) / result.read_bandwidth;
}

Table stage_table(const FramesBenchResult& result) {
  Table table{
      "A frame, ms", {"stage", "median", "p95", "p99", "most", "share", "MB moved", "of read bandwidth"}, {}};
  const auto add = [&](const std::string& name, const Spread& spread, double bytes) {
    table.rows.push_back(spread_row(name, spread));
    auto& row = table.rows.back();
    row.push_back(figure(100.0 * spread.median / result.frame.median) + " %");
    row.push_back(bytes > 0.0 ? figure(bytes / 1e6) : "-");
    row.push_back(bytes > 0.0 ? figure(100.0 * share_of_bandwidth(result, bytes, spread.median)) + " %"
                              : "-");
  };
  for (const StageResult& stage : result.stages) {
    if (stage.milliseconds.max == 0.0) continue;  // no part of this form of frame
    add(stage.name, stage.milliseconds, stage.name == kSolve ? result.bytes_of_solves : 0.0);
  }
  add("whole frame", result.frame, 0.0);
  return table;
}

Table count_table(const FramesBenchResult& result) {
  Table table{"Counts a frame", {"", "median", "p95", "p99", "most"}, {}};
  table.rows.push_back(spread_row("cycles", result.cycles));
  table.rows.push_back(spread_row("solves", result.solves));
  table.title += "; largest error of any node in any frame " + error_figure(result.error) +
                 " of the diagonal (estimate), " + std::to_string(result.unconverged) +
                 " frames short of the tolerance";
  return table;
}

Table error_table(const FramesBenchResult& result) {
  const ErrorCheckResult& errors = *result.errors;
  Table table{"Beside a tight solve of every frame: largest distance of any node, share of the diagonal",
              {"", "median", "p95", "p99", "most"},
              {}};
  const Spread& found = errors.difference;
  table.rows.push_back({"distance", error_figure(found.median), error_figure(found.p95),
                        error_figure(found.p99), error_figure(found.max)});
  return table;
}

/// Medians of what a direct solver would replace: starts, cycles, and every residual but the first of each
/// solve, which is its right-hand side.
double replaced_milliseconds(const FramesBenchResult& result) {
  const double more_residuals = 1.0 - result.solves.median / std::max(1.0, result.cycles.median);
  double sum = 0.0;
  for (const StageResult& stage : result.stages) {
    if (stage.name == kStart || stage.name == kSolve) sum += stage.milliseconds.median;
    if (stage.name == kResidual) sum += more_residuals * stage.milliseconds.median;
  }
  return sum;
}

/// What the frame would take with the solves by substitution.
double cholesky_frame_milliseconds(const FramesBenchResult& result) {
  return result.frame.median - replaced_milliseconds(result) + result.cholesky_milliseconds();
}

Table cholesky_table(const FramesBenchResult& result) {
  const double substitution = result.cholesky_milliseconds();
  Table table{"Beside CHOLMOD, median ms", {"", "sinew", "CHOLMOD", "times faster"}, {}};
  const auto add = [&](const std::string& name, double own, double other) {
    table.rows.push_back({name, figure(own), figure(other), figure(other / own)});
  };
  add("solves (with their starts)", replaced_milliseconds(result), substitution);
  add("whole frame", result.frame.median, cholesky_frame_milliseconds(result));
  return table;
}

bool near_size(const FramesBenchResult& result, int free_vertices) {
  return std::abs(static_cast<double>(result.free_vertices) / free_vertices - 1.0) <= kSizeRange;
}

std::vector<Target> frame_targets(const FramesBenchResult& result) {
  std::vector<Target> targets;
  const std::string where = result.mesh + ", " + result.clip;
  const bool paper = result.deform == "paper";
  const double scale = std::max(1.0, kTargetBandwidth / result.read_bandwidth);
  for (const FrameTarget& target : kFrameTargets) {
    if (!near_size(result, target.free_vertices)) continue;
    const double limit = scale * (paper ? target.paper_ms : target.refined_ms);
    targets.push_back({"whole frame, median, at the bandwidth measured", limit, limit, false,
                       result.frame.median, where, " ms"});
  }
  targets.push_back({"99th percentile of the frames over their median", 2, 2, false,
                     result.frame.p99 / result.frame.median, where, " x"});
  if (result.errors) {
    targets.push_back({"distance from the tight solve over the frame's own estimate", 2, 1, false,
                       result.errors->largest_ratio, where, " x"});
  }
  if (result.cholesky_milliseconds() > 0.0 && near_size(result, 500000)) {
    targets.push_back({"start and solve, times faster than CHOLMOD's substitution", 9, 20, true,
                       result.cholesky_milliseconds() / replaced_milliseconds(result), where, " x"});
    targets.push_back({"whole frame, times faster than with CHOLMOD", 8, 15, true,
                       cholesky_frame_milliseconds(result) / result.frame.median, where, " x"});
  }
  return targets;
}

Json spread_record(const Spread& spread) {
  return {
      {"median_ms", spread.median}, {"p95_ms", spread.p95}, {"p99_ms", spread.p99}, {"max_ms", spread.max}};
}

}  // namespace

std::string frames_line(const FramesBenchResult& result) {
  return result.mesh + ", " + std::to_string(result.free_vertices) + " free vertices, " +
         std::to_string(result.surface_vertices) + " on the surface; " + result.clip + ", frames " +
         std::to_string(result.first_frame + 1) + "-" +
         std::to_string(result.first_frame + result.frame_count) + ", --deform " + result.deform + "; " +
         result.processor + ", " + std::to_string(result.threads) + " threads, read bandwidth " +
         figure(result.read_bandwidth / 1e9) + " GB/s";
}

std::vector<Table> frames_tables(const FramesBenchResult& result) {
  std::vector<Table> tables = {stage_table(result), count_table(result)};
  if (result.errors) tables.push_back(error_table(result));
  if (result.cholesky_milliseconds() > 0.0) tables.push_back(cholesky_table(result));
  tables.push_back(target_table(frame_targets(result)));
  return tables;
}

std::string frames_json(const FramesBenchResult& result) {
  Json root;
  root["schema"] = "sinew.bench-frames/1";
  root["machine"] = {{"processor", result.processor}, {"threads", result.threads}};
  root["read_bandwidth_gbs"] = result.read_bandwidth / 1e9;
  for (const auto& [name, value] : result.baseline.settings) root["settings"][name] = value;
  root["frame"] = spread_record(result.frame);
  if (result.cholesky_milliseconds() > 0.0) {
    root["frame"]["cholesky_median_ms"] = result.cholesky_milliseconds();
    root["frame"]["whole_with_cholesky_ms"] = cholesky_frame_milliseconds(result);
  } else if (result.cholesky) {
    root["cholesky_failure"] = result.cholesky->failure;
  }
  for (const StageResult& stage : result.stages) {
    Json& record = root["stages"][stage.name] = spread_record(stage.milliseconds);
    if (stage.name != kSolve || result.bytes_of_solves == 0.0) continue;
    record["bytes"] = result.bytes_of_solves;
    record["bandwidth_share"] = share_of_bandwidth(result, result.bytes_of_solves, stage.milliseconds.median);
  }
  root["largest_error_estimate"] = result.error;
  if (result.errors) {
    root["error_check"] = {{"median", result.errors->difference.median},
                           {"p99", result.errors->difference.p99},
                           {"max", result.errors->difference.max},
                           {"largest_ratio", result.errors->largest_ratio},
                           {"optimistic_frames", result.errors->optimistic}};
  }
  root["unconverged_frames"] = result.unconverged;
  root["cycles"] = {{"median", result.cycles.median}, {"max", result.cycles.max}};
  root["solves"] = {{"median", result.solves.median}, {"max", result.solves.max}};
  for (const auto& [name, count] : result.baseline.counters) root["counters"][name] = count;
  root["samples"] = result.baseline.samples;
  return root.dump(2) + '\n';
}

std::vector<std::string> comparison_lines(const Comparison& comparison, double max_slowdown) {
  const Interval& slowdown = comparison.slowdown;
  std::vector<std::string> lines = {"time over the baseline's: " + figure(slowdown.middle) +
                                    " (90 %: " + figure(slowdown.low) + " to " + figure(slowdown.high) +
                                    "), allowed " + figure(max_slowdown)};
  for (const std::string& counter : comparison.grown) lines.push_back("more " + counter);
  for (const std::string& counter : comparison.shrunk)
    lines.push_back("fewer " + counter + ": save a new baseline");
  return lines;
}

}  // namespace sinew
