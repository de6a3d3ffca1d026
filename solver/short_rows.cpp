#include "solver/short_rows.h"

#include <limits>

#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

/// Rows per block of parallel work.
constexpr int kRowsPerBlock = 4096;

template <typename Step>
ShortRow<Step> row_of(int i, std::span<const int> neighbors) {
  const int count = std::min(kShortRow, static_cast<int>(neighbors.size()));
  int after = 0;  // the first neighbor that is
  while (after < count && neighbors[after] < i) ++after;
  ShortRow<Step> row = {};
  row.own = static_cast<float>(count - kShortRow);
  int place = kAfter + 1;
  for (int k = 0; k < count; ++k) {
    // A full row without one of the two has a neighbor too many for the other places.
    const int spare = after > 0 ? kAfter : kBefore;
    const int own = k == after - 1 ? kBefore : k == after ? kAfter : place < kShortRow ? place++ : spare;
    row.steps[own] = static_cast<Step>(neighbors[k] - i);
  }
  return row;
}

template <typename Step>
LargeVector<ShortRow<Step>> rows_of(std::span<const int> offsets, std::span<const int> neighbors,
                                    ThreadTeam& team) {
  const int n = static_cast<int>(offsets.size()) - 1;
  LargeVector<ShortRow<Step>> rows(static_cast<std::size_t>(n));
  for_items(team, n, kRowsPerBlock, [&](int i) {
    rows[i] = row_of<Step>(i, neighbors.subspan(offsets[i], offsets[i + 1] - offsets[i]));
  });
  return rows;
}

/// Neighbors ascend: the first and the last are the farthest.
int longest_step(std::span<const int> offsets, std::span<const int> neighbors) {
  int longest = 0;
  for (std::size_t i = 0; i + 1 < offsets.size(); ++i) {
    if (offsets[i] == offsets[i + 1]) continue;
    const int row = static_cast<int>(i);
    longest = std::max({longest, row - neighbors[offsets[i]], neighbors[offsets[i + 1] - 1] - row});
  }
  return longest;
}

}  // namespace

std::size_t ShortRows::bytes() const {
  return near.capacity() * sizeof(near[0]) + far.capacity() * sizeof(far[0]) +
         (long_rows.capacity() + rest_offsets.capacity() + rest.capacity()) * sizeof(int);
}

ShortRows short_rows(std::span<const int> offsets, std::span<const int> neighbors, ThreadTeam& team) {
  ShortRows result;
  result.rest_offsets = {0};
  if (longest_step(offsets, neighbors) <= std::numeric_limits<std::int16_t>::max())
    result.near = rows_of<std::int16_t>(offsets, neighbors, team);
  else
    result.far = rows_of<std::int32_t>(offsets, neighbors, team);
  for (std::size_t i = 0; i + 1 < offsets.size(); ++i) {
    if (offsets[i + 1] - offsets[i] <= kShortRow) continue;
    result.long_rows.push_back(static_cast<int>(i));
    result.rest.insert(result.rest.end(), neighbors.begin() + offsets[i] + kShortRow,
                       neighbors.begin() + offsets[i + 1]);
    result.rest_offsets.push_back(static_cast<int>(result.rest.size()));
  }
  return result;
}

}  // namespace sinew
