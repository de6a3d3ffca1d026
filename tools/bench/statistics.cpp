#include "tools/bench/statistics.h"

#include <algorithm>
#include <random>
#include <stdexcept>

namespace sinew {
namespace {

constexpr int kResamplings = 4000;
constexpr double kTail = 0.005;  // on each side
constexpr std::uint32_t kSeed = 20061;

/// The median of as many values, drawn with replacement.
double resampled_median(const std::vector<double>& values, std::mt19937& random, std::vector<double>& drawn) {
  std::uniform_int_distribution<std::size_t> any(0, values.size() - 1);
  drawn.resize(values.size());
  for (double& value : drawn) value = values[any(random)];
  return median(drawn);
}

void check_positive(const std::vector<double>& values) {
  const bool good =
      !values.empty() && std::all_of(values.begin(), values.end(), [](double v) { return v > 0.0; });
  if (!good) throw std::invalid_argument("ratio_of_medians: expected one or more positive numbers");
}

}  // namespace

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

Interval ratio_of_medians(const std::vector<double>& before, const std::vector<double>& now) {
  check_positive(before);
  check_positive(now);
  std::mt19937 random(kSeed);
  std::vector<double> drawn;
  std::vector<double> ratios(kResamplings);
  for (double& ratio : ratios) {
    const double below = resampled_median(before, random, drawn);
    ratio = resampled_median(now, random, drawn) / below;
  }
  std::sort(ratios.begin(), ratios.end());
  const auto at = [&](double share) { return ratios[static_cast<std::size_t>(share * (kResamplings - 1))]; };
  return {at(kTail), median(now) / median(before), at(1.0 - kTail)};
}

}  // namespace sinew
