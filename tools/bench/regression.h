#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "tools/bench/statistics.h"

/// Is it slower than it was? For a build that is to fail when it is, on machines that are never quiet.
///
/// Three things make it hold: a calibration kernel runs between the repeats, and times are told in units of
/// it, so a machine that is slow today is slow for both; medians, so a few disturbed repeats do not count;
/// and the range in which the ratio lies, so a difference is told from chance. What can be counted (cycles,
/// solves, bytes) is compared exactly, without any clock.
namespace sinew {

/// What one version measured, to be kept and compared with.
struct Baseline {
  std::vector<std::pair<std::string, std::string>> settings;  ///< what must be the same to compare at all
  std::vector<std::pair<std::string, std::int64_t>> counters;
  std::vector<double> samples;  ///< one a repeat: time in units of the calibration kernel
};

/// Runs `run_seconds` `repeats` times with `calibration_seconds` before, between and after; each sample is a
/// run's time over the mean of the calibrations round it.
std::vector<double> normalised_samples(int repeats, const std::function<double()>& run_seconds,
                                       const std::function<double()>& calibration_seconds);

struct Comparison {
  Interval slowdown;    ///< now over before, 90 % confidence
  bool slower = false;  ///< the middle is beyond the limit, and no slowdown at all is ruled out
  std::vector<std::string>
      grown;  ///< counters that grew, as "cycles: 240, was 200": slower whatever the clock says
  std::vector<std::string> shrunk;  ///< counters that fell: time for a new baseline

  bool passed() const { return !slower && grown.empty(); }
};

/// Throws UnusableInput naming the setting when the two measured different things.
Comparison compare(const Baseline& before, const Baseline& now, double max_slowdown);

/// To and from JSON ("sinew.bench-baseline/1"). Throws FileError.
void write_baseline(const std::filesystem::path& file, const Baseline& baseline);
Baseline read_baseline(const std::filesystem::path& file);

}  // namespace sinew
