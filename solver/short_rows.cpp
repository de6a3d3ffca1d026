#include "solver/short_rows.h"

#include <array>
#include <cstdlib>
#include <limits>

#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

/// Rows per block of parallel work.
constexpr int kRowsPerBlock = 4096;

/// One row in so many may have a step that does not fit when it is doubled, and costs what a long row does,
/// before all rows take twice the memory.
constexpr int kFarShare = 8;

template <typename Step>
bool fits(int step) {
  return std::abs(step) <= std::numeric_limits<Step>::max() / 2;
}

/// Whether a row with so many neighbors has some that its short row does not hold.
template <typename Step>
bool is_long(const ShortRow<Step>& row, int neighbors) {
  return neighbors > kShortRow + static_cast<int>(row.own);
}

/// The neighbors of row i that its short row holds go to `row`, the others to `left(neighbor)`.
template <typename Step, typename Left>
void split_row(int i, std::span<const int> neighbors, ShortRow<Step>& row, const Left& left) {
  std::array<int, kShortRow> steps;
  int count = 0, after = 0;  // the first neighbor that is after i
  for (const int neighbor : neighbors) {
    if (count == kShortRow || !fits<Step>(neighbor - i)) {
      left(neighbor);
      continue;
    }
    steps[count++] = neighbor - i;
    if (neighbor < i) after = count;
  }
  row = {};
  row.own = static_cast<float>(count - kShortRow);
  int place = kAfter + 1;
  for (int k = 0; k < count; ++k) {
    // A full row without one of the two has a neighbor too many for the other places.
    const int spare = after > 0 ? kAfter : kBefore;
    const int own = k == after - 1 ? kBefore : k == after ? kAfter : place < kShortRow ? place++ : spare;
    row.set_step(own, steps[k]);
  }
}

/// Calls body(i, place) for the rows of [begin, end) outside runs: the `place`-th of them.
template <typename Body>
void for_each_loose_row(const std::vector<LatticeRun>& runs, int begin, int end, const Body& body) {
  ascend_parts(
      runs, begin, end,
      [&](int first, int last, int before) {
        for (int i = first; i < last; ++i) body(i, i - before);
      },
      [](const LatticeRun&, int, int) {});
}

template <typename Step>
void fill(std::span<const int> offsets, std::span<const int> neighbors, ThreadTeam& team,
          LargeVector<ShortRow<Step>>& rows, ShortRows& result) {
  const int n = static_cast<int>(offsets.size()) - 1;
  const auto neighbors_of = [&](int i) { return neighbors.subspan(offsets[i], offsets[i + 1] - offsets[i]); };
  rows.resize(static_cast<std::size_t>(n - row_count(result.runs)));
  for_runs(team, n, kRowsPerBlock, [&](int begin, int end) {
    for_each_loose_row(result.runs, begin, end, [&](int i, int place) {
      split_row<Step>(i, neighbors_of(i), rows[place], [](int) {});
    });
  });
  result.rest_offsets = {0};
  for_each_loose_row(result.runs, 0, n, [&](int i, int place) {
    if (!is_long(rows[place], offsets[i + 1] - offsets[i])) return;
    ShortRow<Step> row;
    split_row<Step>(i, neighbors_of(i), row, [&](int neighbor) { result.rest.push_back(neighbor); });
    for (; result.rest.size() % kRestGroup != 0; --rows[place].own) result.rest.push_back(i);
    result.long_rows.push_back(i);
    result.rest_offsets.push_back(static_cast<int>(result.rest.size()));
  });
}

/// Whether so few rows outside runs have a step that does not fit into 16 bits that these had better be long
/// rows. Neighbors ascend: the first and the last are the farthest.
bool mostly_near(std::span<const int> offsets, std::span<const int> neighbors,
                 const std::vector<LatticeRun>& runs) {
  const int n = static_cast<int>(offsets.size()) - 1;
  int far = 0;
  for_each_loose_row(runs, 0, n, [&](int i, int) {
    if (offsets[i] == offsets[i + 1]) return;
    const bool near = fits<std::int16_t>(neighbors[offsets[i]] - i) &&
                      fits<std::int16_t>(neighbors[offsets[i + 1] - 1] - i);
    far += near ? 0 : 1;
  });
  return far <= (n - row_count(runs)) / kFarShare;
}

}  // namespace

std::size_t ShortRows::bytes() const {
  return runs.capacity() * sizeof(runs[0]) + near.capacity() * sizeof(near[0]) +
         far.capacity() * sizeof(far[0]) +
         (long_rows.capacity() + rest_offsets.capacity() + rest.capacity()) * sizeof(int);
}

ShortRows short_rows(std::span<const int> offsets, std::span<const int> neighbors,
                     std::span<const float> diagonal, ThreadTeam& team) {
  ShortRows result;
  result.runs =
      lattice_runs(offsets, neighbors, [&](int first, int row) { return diagonal[row] == diagonal[first]; });
  if (mostly_near(offsets, neighbors, result.runs))
    fill(offsets, neighbors, team, result.near, result);
  else
    fill(offsets, neighbors, team, result.far, result);
  return result;
}

}  // namespace sinew
