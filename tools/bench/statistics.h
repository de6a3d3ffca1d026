#pragma once

#include <vector>

namespace sinew {

/// The middle value, or the mean of the two middle ones; 0 without any.
double median(std::vector<double> values);

/// A number with the range that it lies in with the stated confidence.
struct Interval {
  double low = 0.0;
  double middle = 0.0;
  double high = 0.0;
};

/// How many times larger `now` is than `before`: the median of the ratios of all pairs [Hodges, Lehmann
/// 1963], with the range of 90 % confidence that the ranks of those ratios give [Moses 1965]. A few wild
/// values on either side hardly move it. Throws std::invalid_argument when a list is empty or holds a number
/// that is not positive.
Interval ratio_of(const std::vector<double>& before, const std::vector<double>& now);

}  // namespace sinew
