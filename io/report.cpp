#include "io/report.h"

#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <ostream>
#include <thread>

#include "io/atomic_file.h"
#include "io/sha256.h"

namespace sinew {
namespace {

using Json = nlohmann::ordered_json;

/// Measuring the residual is no part of a frame's work.
double total(const FrameReport& report) {
  double sum = 0.0;
  for (int stage = 0; stage < kFrameStageCount; ++stage) {
    if (static_cast<FrameStage>(stage) != FrameStage::measure) {
      sum += report.milliseconds[static_cast<std::size_t>(stage)];
    }
  }
  return sum;
}

template <typename Value>
std::vector<double> collect(const Report& report, const Value& value) {
  std::vector<double> values;
  for (const FrameRecord& frame : report.frames) values.push_back(static_cast<double>(value(frame)));
  return values;
}

Spread total_spread(const Report& report) {
  return spread_of(collect(report, [](const FrameRecord& frame) { return total(frame.report); }));
}

Spread stage_spread(const Report& report, int stage) {
  return spread_of(collect(report, [stage](const FrameRecord& frame) {
    return frame.report.milliseconds[static_cast<std::size_t>(stage)];
  }));
}

Spread cycle_spread(const Report& report) {
  return spread_of(collect(report, [](const FrameRecord& frame) { return frame.report.cycles; }));
}

std::vector<double> volume_ratios(const Report& report) {
  return collect(report, [](const FrameRecord& frame) { return frame.volume_ratio; });
}

double lowest(const std::vector<double>& values) {
  return values.empty() ? 0.0 : *std::ranges::min_element(values);
}

double worst_error(const Report& report) {
  return spread_of(collect(report, [](const FrameRecord& frame) { return frame.report.error; })).max;
}

double worst_residual(const Report& report) {
  return spread_of(collect(report, [](const FrameRecord& frame) { return frame.report.residual; })).max;
}

std::vector<int> unconverged_frames(const Report& report) {
  std::vector<int> frames;
  for (const FrameRecord& frame : report.frames)
    if (!frame.report.converged) frames.push_back(frame.frame);
  return frames;
}

double frames_per_second(const Report& report) {
  if (report.frames_milliseconds <= 0.0) return 0.0;
  return 1000.0 * static_cast<double>(report.frames.size()) / report.frames_milliseconds;
}

Json json_of(const Spread& spread) {
  return {{"median", spread.median}, {"p95", spread.p95}, {"p99", spread.p99}, {"max", spread.max}};
}

Json inputs_json(const Report& report) {
  Json list = Json::array();
  for (const InputRecord& input : report.inputs)
    list.push_back(
        {{"role", input.role}, {"path", input.path}, {"bytes", input.bytes}, {"sha256", input.sha256}});
  return list;
}

Json options_json(const Report& report) {
  Json object = Json::object();
  for (const auto& [name, value] : report.options) object[name] = value;
  return object;
}

Json machine_json(const MachineRecord& machine) {
  return {{"processor", machine.processor},
          {"hardware_threads", machine.hardware_threads},
          {"threads", machine.threads},
          {"native", machine.native}};
}

Json setup_json(const TimingReport& setup) {
  Json stages = Json::object();
  for (const auto& [name, milliseconds] : setup.stages()) stages[name] = milliseconds;
  return {{"total_ms", setup.total()}, {"stages_ms", stages}};
}

Json sizes_json(const SizeRecord& sizes) {
  return {{"surface_vertices", sizes.surface_vertices},
          {"surface_triangles", sizes.surface_triangles},
          {"graph_nodes", sizes.graph_nodes},
          {"free_nodes", sizes.free_nodes},
          {"edges", sizes.edges},
          {"rig_bytes", sizes.rig_bytes}};
}

Json summary_json(const Report& report) {
  const std::vector<double> volumes = volume_ratios(report);
  const Spread volume = spread_of(volumes);
  const Spread farthest =
      spread_of(collect(report, [](const FrameRecord& frame) { return frame.farthest_from_skeleton; }));
  Json stages = Json::object();
  stages["total"] = json_of(total_spread(report));
  for (int stage = 0; stage < kFrameStageCount; ++stage)
    stages[stage_name(static_cast<FrameStage>(stage))] = json_of(stage_spread(report, stage));
  return {{"frames", report.frames.size()},
          {"frames_wall_ms", report.frames_milliseconds},
          {"frames_per_second", frames_per_second(report)},
          {"ms", stages},
          {"cycles", json_of(cycle_spread(report))},
          {"worst_error", report.preview ? Json(nullptr) : Json(worst_error(report))},
          {"worst_residual", worst_residual(report)},
          {"unconverged_frames", unconverged_frames(report)},
          {"volume_ratio", {{"min", lowest(volumes)}, {"median", volume.median}, {"max", volume.max}}},
          {"farthest_from_skeleton", farthest.max},
          {"peak_memory_bytes", report.peak_memory_bytes}};
}

Json output_json(const Report& report) {
  if (report.output.empty()) return nullptr;
  const GltfWriteReport& written = report.written;
  return {{"path", report.output},
          {"bytes", written.bytes},
          {"write_ms", report.write_milliseconds},
          {"targets", written.targets},
          {"max_error", written.max_error},
          {"p999_error", written.p999_error},
          {"rms_error", written.rms_error}};
}

Json preview_json(const Report& report) {
  if (!report.preview) return nullptr;
  return {{"largest_error", report.preview->largest},
          {"rms_error", report.preview->rms},
          {"worst_frame", report.preview->worst_frame},
          {"frames_measured", report.preview->frames}};
}

Json frame_json(const FrameRecord& frame) {
  Json milliseconds = Json::object();
  milliseconds["total"] = total(frame.report);
  for (int stage = 0; stage < kFrameStageCount; ++stage)
    milliseconds[stage_name(static_cast<FrameStage>(stage))] =
        frame.report.milliseconds[static_cast<std::size_t>(stage)];
  return {{"frame", frame.frame},
          {"solves", frame.report.solves},
          {"cycles", frame.report.cycles},
          {"full_cycles", frame.report.full_cycles},
          {"whole_cycles", frame.report.whole_cycles},
          {"light_cycles", frame.report.light_cycles},
          {"error", frame.report.solves > 0 ? Json(frame.report.error) : Json(nullptr)},
          {"residual", frame.report.residual},
          {"converged", frame.report.converged},
          {"ms", milliseconds},
          {"volume_ratio", frame.volume_ratio},
          {"farthest_from_skeleton", frame.farthest_from_skeleton}};
}

/// printf's formatting for a table line.
template <typename... Values>
std::string line(const char* format, Values... values) {
  char text[256];
  std::snprintf(text, sizeof text, format, values...);
  return text;
}

void print_milliseconds(std::ostream& out, const char* name, const Spread& spread) {
  out << line("  %-18s %9.2f %9.2f %9.2f %9.2f\n", name, spread.median, spread.p95, spread.p99, spread.max);
}

void print_solver(std::ostream& out, const Report& report) {
  const Spread cycles = cycle_spread(report);
  out << line(
      "solver   cycles median %.0f, max %.0f; largest error %.1e of the diagonal (estimate); %zu frames short of "
      "the tolerance\n",
      cycles.median, cycles.max, worst_error(report), unconverged_frames(report).size());
}

void print_frames(std::ostream& out, const Report& report) {
  out << line("frames   %zu in %.2f s, %.1f a second, %d threads\n", report.frames.size(),
              report.frames_milliseconds / 1000.0, frames_per_second(report), report.machine.threads);
  out << line("  %-18s %9s %9s %9s %9s\n", "ms a frame", "median", "p95", "p99", "max");
  print_milliseconds(out, "total", total_spread(report));
  for (int stage = 0; stage < kFrameStageCount && !report.preview; ++stage)
    print_milliseconds(out, stage_name(static_cast<FrameStage>(stage)), stage_spread(report, stage));
  if (report.preview) {
    out << line(
        "preview  unsolved; beside %zu solved frames: largest error %.1e of the diagonal (frame %d), rms %.1e\n",
        report.preview->frames.size(), report.preview->largest, report.preview->worst_frame + 1,
        report.preview->rms);
  } else {
    print_solver(out, report);
  }
  const std::vector<double> volumes = volume_ratios(report);
  const Spread volume = spread_of(volumes);
  out << line("volume   %.1f %% to %.1f %% of rest, median %.1f %%\n", 100.0 * lowest(volumes),
              100.0 * volume.max, 100.0 * volume.median);
}

}  // namespace

InputRecord describe_input(const std::string& role, const std::filesystem::path& path) {
  const std::vector<std::byte> bytes = read_whole_file(path, std::numeric_limits<std::uint32_t>::max());
  return {role, path.string(), static_cast<std::int64_t>(bytes.size()), sha256(bytes)};
}

MachineRecord describe_machine(int threads) {
  MachineRecord machine{.processor = "unknown",
                        .hardware_threads = static_cast<int>(std::thread::hardware_concurrency()),
                        .threads = threads,
                        .native = SINEW_IS_NATIVE};
  std::ifstream facts("/proc/cpuinfo");
  for (std::string text; std::getline(facts, text);) {
    const std::size_t colon = text.find(": ");
    if (!text.starts_with("model name") || colon == std::string::npos) continue;
    machine.processor = text.substr(colon + 2);
    break;
  }
  return machine;
}

std::int64_t peak_memory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return 1024LL * usage.ru_maxrss;
}

Spread spread_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const auto rank = [&values](double share) {
    const auto nearest = static_cast<std::size_t>(std::ceil(share * static_cast<double>(values.size())));
    return values[std::clamp<std::size_t>(nearest, 1, values.size()) - 1];
  };
  return {.median = rank(0.5), .p95 = rank(0.95), .p99 = rank(0.99), .max = values.back()};
}

std::string report_json(const Report& report) {
  Json frames = Json::array();
  for (const FrameRecord& frame : report.frames) frames.push_back(frame_json(frame));
  const Json json = {{"schema", "sinew.report/1"},
                     {"tool", {{"name", "sinew"}, {"version", SINEW_VERSION}}},
                     {"inputs", inputs_json(report)},
                     {"options", options_json(report)},
                     {"machine", machine_json(report.machine)},
                     {"warnings", report.warnings},
                     {"setup", setup_json(report.setup)},
                     {"sizes", sizes_json(report.sizes)},
                     {"summary", summary_json(report)},
                     {"preview", preview_json(report)},
                     {"output", output_json(report)},
                     {"frames", frames}};
  // Paths and options may hold bytes that are not UTF-8; they become the replacement character.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

void write_report(const std::filesystem::path& path, const Report& report) {
  AtomicFile file(path);
  file.write(report_json(report));
  file.commit();
}

std::ostream& operator<<(std::ostream& out, const Report& report) {
  const SizeRecord& sizes = report.sizes;
  out << line("body     %lld vertices, %lld nodes, %lld free, %lld edges\n",
              static_cast<long long>(sizes.surface_vertices), static_cast<long long>(sizes.graph_nodes),
              static_cast<long long>(sizes.free_nodes), static_cast<long long>(sizes.edges));
  out << line("setup    %.2f s\n", report.setup.total() / 1000.0);
  for (const auto& [name, milliseconds] : report.setup.stages())
    out << line("  %-18s %9.1f ms\n", name.c_str(), milliseconds);
  if (!report.frames.empty()) print_frames(out, report);
  if (!report.output.empty()) {
    const GltfWriteReport& written = report.written;
    out << line("written  %.1f MB in %.2f s, %d targets; error p99.9 %.1e, max %.1e of the diagonal\n",
                static_cast<double>(written.bytes) / 1e6, report.write_milliseconds / 1000.0, written.targets,
                written.p999_error, written.max_error);
  }
  if (report.peak_memory_bytes > 0)
    out << line("memory   %.0f MB at most\n", static_cast<double>(report.peak_memory_bytes) / 1e6);
  return out;
}

}  // namespace sinew
