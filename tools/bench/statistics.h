#pragma once

#include <cstdint>
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

/// The ratio of the medians, `now` over `before`, with the range of 99 % confidence by resampling both with
/// replacement [Efron 1979]. Deterministic: the resampling has a seed of its own. Throws
/// std::invalid_argument when a list is empty or holds a number that is not positive.
Interval ratio_of_medians(const std::vector<double>& before, const std::vector<double>& now);

}  // namespace sinew
