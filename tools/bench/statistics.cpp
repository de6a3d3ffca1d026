#include "tools/bench/statistics.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace sinew {
namespace {

/// Of the normal distribution, 5 % beyond on each side.
constexpr double kQuantile = 1.645;

void check_positive(const std::vector<double>& values) {
  const bool good =
      !values.empty() && std::all_of(values.begin(), values.end(), [](double v) { return v > 0.0; });
  if (!good) throw std::invalid_argument("ratio_of: expected one or more positive numbers");
}

}  // namespace

double median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::max_element(values.begin(), middle));
}

Interval ratio_of(const std::vector<double>& before, const std::vector<double>& now) {
  check_positive(before);
  check_positive(now);
  std::vector<double> ratios;
  for (const double old : before)
    for (const double value : now) ratios.push_back(value / old);
  std::sort(ratios.begin(), ratios.end());
  // How many pairs of two samples of one distribution are in order is nearly normal, with this deviation.
  const auto m = static_cast<double>(before.size()), n = static_cast<double>(now.size());
  const double deviation = std::sqrt(m * n * (m + n + 1.0) / 12.0);
  const double rank = std::max(0.0, std::floor(0.5 * m * n - kQuantile * deviation));
  const auto low = static_cast<std::size_t>(rank);
  return {ratios[low], median(ratios), ratios[ratios.size() - 1 - low]};
}

}  // namespace sinew
