#include "tools/bench/peer_run.h"

#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "pipeline/worker_process.h"
#include "skeleton/unusable_input.h"
#include "tools/bench/statistics.h"

namespace sinew {
namespace {

using nlohmann::json;

constexpr const char* kProgram = "sinew-bench-peer";

/// A sanitizer's shadow memory would not fit any limit on the address space.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kLimitMemory = false;
#else
constexpr bool kLimitMemory = true;
#endif
constexpr double kNoLimit = 1e9;  // megabytes

/// Beside the running program, where installation and build put it.
std::string peer_program() {
  std::error_code ignored;
  const auto self = std::filesystem::read_symlink("/proc/self/exe", ignored);
  const auto program = self.parent_path() / kProgram;
  if (!std::filesystem::exists(program, ignored)) {
    throw UnusableInput("there is no " + program.string() + ", which runs the solvers to compare");
  }
  return program;
}

PeerResult read_result(const std::string& text) {
  const json measured = json::parse(text);
  PeerResult result;
  result.setup_s = measured.at("setup_s");
  result.memory_mb = measured.at("memory_mb");
  result.peak_mb = measured.at("peak_mb");
  result.solver_mb = measured.at("solver_bytes").get<double>() / 1e6;
  result.settings = measured.at("settings");
  result.figures = measured.at("figures").get<std::map<std::string, double>>();
  for (const json& solve : measured.at("solves")) {
    result.solves.push_back({solve.at("tolerance"), solve.at("seconds"), solve.at("least_seconds"),
                             solve.at("iterations"), solve.at("residual"), solve.at("vertex_error"),
                             solve.at("reached")});
  }
  return result;
}

}  // namespace

const PeerSolve* PeerResult::at(double tolerance) const {
  for (const PeerSolve& solve : solves) {
    if (solve.tolerance == tolerance) return &solve;
  }
  return nullptr;
}

PeerResult median_of(const std::vector<PeerResult>& rounds) {
  PeerResult result = rounds.front();
  for (const PeerResult& round : rounds) {
    if (!round.finished()) return round;
  }
  const auto middle = [&](const auto& value) {
    std::vector<double> values;
    for (const PeerResult& round : rounds) values.push_back(value(round));
    return median(std::move(values));
  };
  result.setup_s = middle([](const PeerResult& round) { return round.setup_s; });
  result.memory_mb = middle([](const PeerResult& round) { return round.memory_mb; });
  result.peak_mb = middle([](const PeerResult& round) { return round.peak_mb; });
  for (std::size_t k = 0; k < result.solves.size(); ++k) {
    result.solves[k].seconds = middle([&](const PeerResult& round) { return round.solves[k].seconds; });
  }
  for (auto& [name, value] : result.figures) {
    value = middle([&](const PeerResult& round) { return round.figures.at(name); });
  }
  return result;
}

std::vector<std::string> peers_at_hand() {
  const WorkerResult list = run_worker(peer_program(), {}, {.seconds = 20.0, .megabytes = kNoLimit});
  if (!list.failure.empty()) throw std::runtime_error(std::string(kProgram) + " " + list.failure);
  std::vector<std::string> names;
  std::istringstream lines(list.output);
  for (std::string name; std::getline(lines, name);) names.push_back(name);
  return names;
}

PeerResult run_peer(const std::string& solver, const std::filesystem::path& file,
                    const std::vector<double>& tolerances, const PeerLimits& limits) {
  const json job = {{"solver", solver},          {"file", file.string()},     {"threads", limits.threads},
                    {"repeats", limits.repeats}, {"seconds", limits.seconds}, {"tolerances", tolerances}};
  // The job's own alarm counts the wall clock; this limit also counts the processor time of all threads.
  const WorkerLimits worker{.seconds = limits.seconds * limits.threads + 10.0,
                            .megabytes = kLimitMemory ? limits.megabytes : kNoLimit};
  const WorkerResult run = run_worker(peer_program(), job.dump(), worker);
  if (run.failure.empty()) return read_result(run.output);
  PeerResult result;
  std::ostringstream limit;
  limit << "not finished within " << limits.seconds << " s and " << limits.megabytes
        << " MB: " << run.failure;
  result.failure = limit.str();
  return result;
}

}  // namespace sinew
