// Is it slower than it was? Statistics on synthetic times with a fixed seed, no clock involved.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <fstream>
#include <random>

#include "io/file_error.h"
#include "skeleton/unusable_input.h"
#include "tools/bench/regression.h"

namespace sinew {
namespace {

constexpr double kLimit = 1.15;
constexpr int kRepeats = 9;

/// A machine on which nothing is ever quiet: its speed wanders by tens of per cent, every time has noise of
/// its own, and now and then something else gets in between.
class NoisyMachine {
 public:
  explicit NoisyMachine(unsigned seed) : random_(seed), speed_(std::exp(0.2 * normal_(random_))) {}

  /// What a clock would show for work that takes `seconds` on a quiet machine.
  double clocked(double seconds) {
    speed_ *= std::exp(0.03 * normal_(random_));
    const double disturbance = std::uniform_real_distribution<double>(0, 1)(random_) < 0.1 ? 1.4 : 1.0;
    return seconds * speed_ * disturbance * std::exp(0.04 * normal_(random_));
  }

  /// As Calibration::seconds() is: the middle of five tries.
  double calibrated() {
    std::vector<double> tries(5);
    for (double& seconds : tries) seconds = clocked(0.05);
    return median(tries);
  }

 private:
  std::mt19937 random_;
  std::normal_distribution<double> normal_;
  double speed_;
};

Baseline measured(unsigned seed, double slowdown) {
  NoisyMachine machine(seed);
  Baseline baseline;
  baseline.settings = {{"mesh", "ogre"}, {"threads", "2"}};
  baseline.counters = {{"cycles", 200}, {"bytes of the rig", 1000}};
  baseline.samples = normalised_samples(
      kRepeats, [&] { return machine.clocked(2.0 * slowdown); }, [&] { return machine.calibrated(); });
  return baseline;
}

TEST(Statistics, median_of_few) {
  EXPECT_EQ(median({}), 0.0);
  EXPECT_EQ(median({3}), 3.0);
  EXPECT_EQ(median({4, 1}), 2.5);
  EXPECT_EQ(median({9, 1, 5}), 5.0);
  EXPECT_EQ(median({9, 1, 5, 6}), 5.5);
}

TEST(Statistics, a_ratio_lies_in_its_range_and_scales_with_the_times) {
  const std::vector<double> before = {1.0, 1.1, 0.9, 1.05, 0.95};
  std::vector<double> now = before;
  const Interval same = ratio_of(before, now);
  EXPECT_DOUBLE_EQ(same.middle, 1.0);
  EXPECT_LT(same.low, 1.0);
  EXPECT_GT(same.high, 1.0);
  for (double& value : now) value *= 3.0;
  const Interval thrice = ratio_of(before, now);
  EXPECT_NEAR(thrice.low, 3.0 * same.low, 1e-12);
  EXPECT_NEAR(thrice.middle, 3.0 * same.middle, 1e-12);
  EXPECT_NEAR(thrice.high, 3.0 * same.high, 1e-12);
}

TEST(Statistics, a_ratio_needs_positive_numbers) {
  for (const std::vector<double>& bad : {std::vector<double>{}, {1.0, 0.0}, {1.0, std::nan("")}}) {
    try {
      ratio_of({1.0}, bad);
      FAIL() << "accepted";
    } catch (const std::invalid_argument& error) {
      EXPECT_STREQ(error.what(), "ratio_of: expected one or more positive numbers");
    }
  }
}

TEST(Statistics, the_range_covers_the_true_ratio) {
  int covered = 0;
  for (unsigned trial = 0; trial < 100; ++trial) {
    const Interval range = compare(measured(1000 + trial, 1.0), measured(2000 + trial, 1.2), kLimit).slowdown;
    if (range.low <= 1.2 && 1.2 <= range.high) ++covered;
  }
  EXPECT_GE(covered, 80);  // of few samples, and samples next to each other share the machine
}

TEST(NormalisedSamples, a_calibration_stands_on_both_sides_of_every_run) {
  std::string order;
  const auto samples = normalised_samples(
      3, [&] { return order += 'r', 6.0; },
      [&] { return order += 'c', static_cast<double>(order.size()); });  // 1, 3, 5, 7: ever slower
  EXPECT_EQ(order, "crcrcrc");
  EXPECT_EQ(samples, (std::vector<double>{6.0 / 2.0, 6.0 / 4.0, 6.0 / 6.0}));
}

TEST(Regression, a_slowdown_of_a_third_is_caught) {
  for (unsigned trial = 0; trial < 20; ++trial) {
    EXPECT_FALSE(compare(measured(trial, 1.0), measured(100 + trial, 1.3), kLimit).passed()) << trial;
  }
}

TEST(Regression, twenty_unchanged_runs_are_not_flagged) {
  for (unsigned trial = 0; trial < 20; ++trial) {
    const Comparison comparison = compare(measured(trial, 1.0), measured(100 + trial, 1.0), kLimit);
    EXPECT_TRUE(comparison.passed()) << trial << ": " << comparison.slowdown.middle;
  }
}

TEST(Regression, a_faster_version_passes) {
  EXPECT_TRUE(compare(measured(1, 1.0), measured(2, 0.5), kLimit).passed());
}

TEST(Regression, a_machine_half_as_fast_changes_nothing) {
  Baseline now = measured(1, 1.0);
  NoisyMachine machine(1);
  now.samples = normalised_samples(
      kRepeats, [&] { return 2.0 * machine.clocked(2.0); }, [&] { return 2.0 * machine.calibrated(); });
  EXPECT_NEAR(compare(measured(1, 1.0), now, kLimit).slowdown.middle, 1.0, 1e-12);
}

TEST(Regression, a_counter_that_grew_fails_whatever_the_clock_says) {
  Baseline now = measured(2, 0.5);
  now.counters[0].second = 201;
  const Comparison comparison = compare(measured(1, 1.0), now, kLimit);
  EXPECT_FALSE(comparison.passed());
  EXPECT_FALSE(comparison.slower);
  EXPECT_EQ(comparison.grown, std::vector<std::string>{"cycles: 201, was 200"});
}

TEST(Regression, a_counter_that_fell_is_told_and_passes) {
  Baseline now = measured(2, 1.0);
  now.counters[1].second = 999;
  const Comparison comparison = compare(measured(1, 1.0), now, kLimit);
  EXPECT_TRUE(comparison.passed());
  EXPECT_EQ(comparison.shrunk, std::vector<std::string>{"bytes of the rig: 999, was 1000"});
}

TEST(Regression, different_measurements_are_not_compared) {
  Baseline now = measured(2, 1.0);
  now.settings[1].second = "8";
  try {
    compare(measured(1, 1.0), now, kLimit);
    FAIL() << "compared";
  } catch (const UnusableInput& error) {
    EXPECT_STREQ(error.what(), "the baseline was measured with threads '2', this run with '8'");
  }
}

TEST(Baseline, comes_back_from_its_file_and_damaged_ones_are_refused) {
  const auto file = std::filesystem::temp_directory_path() / ("sinew-baseline-" + std::to_string(getpid()));
  const Baseline baseline = measured(1, 1.0);
  write_baseline(file, baseline);
  const Baseline back = read_baseline(file);
  EXPECT_EQ(back.settings, baseline.settings);
  EXPECT_EQ(back.counters, baseline.counters);
  EXPECT_EQ(back.samples, baseline.samples);
  for (const char* text :
       {"", "{", "[]", "{\"schema\": \"other\"}", "{\"schema\": \"sinew.bench-baseline/1\"}",
        "{\"schema\": \"sinew.bench-baseline/1\", \"settings\": {}, \"counters\": {}, "
        "\"samples\": [1, -1]}"}) {
    std::ofstream(file, std::ios::trunc) << text;
    EXPECT_THROW(read_baseline(file), FileError) << text;
  }
  std::filesystem::remove(file);
  EXPECT_THROW(read_baseline(file), FileError);
}

}  // namespace
}  // namespace sinew
