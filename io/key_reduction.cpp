#include "io/key_reduction.h"

#include <algorithm>
#include <cstddef>

namespace sinew {
namespace {

/// Bounds the work on a clip that stands still, where every run would reach to the end.
constexpr int kLongestRun = 64;

bool interpolation_gives(FrameSpan frames, int from, int to, int frame, double tolerance) {
  const std::vector<float>& a = frames[static_cast<std::size_t>(from)];
  const std::vector<float>& b = frames[static_cast<std::size_t>(to)];
  const std::vector<float>& truth = frames[static_cast<std::size_t>(frame)];
  const double share = static_cast<double>(frame - from) / (to - from);
  for (std::size_t i = 0; i + 2 < truth.size(); i += 3) {
    double squared = 0.0;
    for (std::size_t axis = i; axis < i + 3; ++axis) {
      const double between =
          (1.0 - share) * static_cast<double>(a[axis]) + share * static_cast<double>(b[axis]);
      const double difference = between - static_cast<double>(truth[axis]);
      squared += difference * difference;
    }
    if (squared > tolerance * tolerance) return false;
  }
  return true;
}

bool run_is_linear(FrameSpan frames, int from, int to, double tolerance) {
  // The middle of a run deviates most; asking it first ends most failing runs early.
  if (!interpolation_gives(frames, from, to, (from + to) / 2, tolerance)) return false;
  for (int frame = from + 1; frame < to; ++frame)
    if (!interpolation_gives(frames, from, to, frame, tolerance)) return false;
  return true;
}

}  // namespace

std::vector<int> keys_to_keep(FrameSpan frames, double tolerance) {
  const int count = static_cast<int>(frames.size());
  std::vector<int> keys;
  for (int key = 0; key < count;) {
    keys.push_back(key);
    int next = key + 1;
    while (tolerance > 0.0 && next + 1 < count && next - key < kLongestRun &&
           run_is_linear(frames, key, next + 1, tolerance))
      ++next;
    key = next;
  }
  return keys;
}

}  // namespace sinew
