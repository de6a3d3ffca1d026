#include "tools/bench/regression.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "io/atomic_file.h"
#include "io/file_error.h"
#include "skeleton/unusable_input.h"
#include "tools/bench/bench_files.h"

namespace sinew {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kSchema = "sinew.bench-baseline/1";
constexpr std::size_t kLargestFile = 16u << 20;

std::string in_words(const std::string& value) {
  return value.empty() ? "nothing" : "'" + value + "'";
}

template <typename Value>
Value value_of(const std::vector<std::pair<std::string, Value>>& list, const std::string& name) {
  const auto found =
      std::find_if(list.begin(), list.end(), [&](const auto& entry) { return entry.first == name; });
  return found == list.end() ? Value{} : found->second;
}

void check_settings(const Baseline& before, const Baseline& now) {
  for (const auto& [name, value] : now.settings) {
    const std::string old = value_of(before.settings, name);
    if (old == value) continue;
    throw UnusableInput("the baseline was measured with " + name + " " + in_words(old) + ", this run with " +
                        in_words(value));
  }
}

}  // namespace

std::vector<double> normalised_samples(int repeats, const std::function<double()>& run_seconds,
                                       const std::function<double()>& calibration_seconds) {
  std::vector<double> samples;
  double before = calibration_seconds();
  for (int repeat = 0; repeat < repeats; ++repeat) {
    const double run = run_seconds();
    const double after = calibration_seconds();
    samples.push_back(run / (0.5 * (before + after)));
    before = after;
  }
  return samples;
}

Comparison compare(const Baseline& before, const Baseline& now, double max_slowdown) {
  check_settings(before, now);
  Comparison comparison;
  comparison.slowdown = ratio_of(before.samples, now.samples);
  comparison.slower = comparison.slowdown.middle > max_slowdown && comparison.slowdown.low > 1.0;
  for (const auto& [name, count] : now.counters) {
    const std::int64_t old = value_of(before.counters, name);
    if (count == old) continue;
    auto& list = count > old ? comparison.grown : comparison.shrunk;
    list.push_back(name + ": " + std::to_string(count) + ", was " + std::to_string(old));
  }
  return comparison;
}

void write_baseline(const std::filesystem::path& file, const Baseline& baseline) {
  Json root;
  root["schema"] = kSchema;
  for (const auto& [name, value] : baseline.settings) root["settings"][name] = value;
  for (const auto& [name, count] : baseline.counters) root["counters"][name] = count;
  root["samples"] = baseline.samples;
  write_text(file, root.dump(2) + '\n');
}

Baseline read_baseline(const std::filesystem::path& file) {
  const std::vector<std::byte> bytes = read_whole_file(file, kLargestFile);
  const auto* const text = reinterpret_cast<const char*>(bytes.data());
  try {
    const Json root = Json::parse(text, text + bytes.size());
    if (root.at("schema") != kSchema)
      throw FileError(FileFault::malformed, file.string(), "is not a baseline");
    Baseline baseline;
    for (const auto& [name, value] : root.at("settings").items()) baseline.settings.emplace_back(name, value);
    for (const auto& [name, count] : root.at("counters").items()) baseline.counters.emplace_back(name, count);
    baseline.samples = root.at("samples").get<std::vector<double>>();
    const bool good =
        !baseline.samples.empty() && std::all_of(baseline.samples.begin(), baseline.samples.end(),
                                                 [](double sample) { return sample > 0.0; });
    if (!good)
      throw FileError(FileFault::malformed, file.string() + ":/samples", "expected positive numbers");
    return baseline;
  } catch (const Json::exception& error) {
    throw FileError(FileFault::malformed, file.string(), std::string("is not a baseline: ") + error.what());
  }
}

}  // namespace sinew
