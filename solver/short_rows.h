#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "solver/large_pages.h"
#include "solver/lattice_runs.h"
#include "solver/thread_team.h"

/// Internal to solver/: where the neighbors of a row are, when all off-diagonal entries have one weight.
namespace sinew {

/// Neighbors that a row holds itself.
constexpr int kShortRow = kLatticeNeighbors;

/// The other neighbors of a long row are summed so many at a time.
constexpr int kRestGroup = 4;

/// Steps that have places of their own: to the nearest row before and to the nearest one after. A sweep that
/// has just come from there adds it last, so that it has to wait for one addition rather than for all.
constexpr int kBefore = 0;
constexpr int kAfter = 1;

/// The first neighbors of one row, as steps from the row itself: kBefore, kAfter, then the others. Unused
/// steps are 0: they lead to the row itself as often as `own` takes it away again, so that no row needs a
/// loop of its own length. A wrong guess of where such a loop ends costs the processor as much as half a row.
template <typename Step>
struct alignas(kShortRow * sizeof(Step) + sizeof(float) > 32 ? 64 : 32) ShortRow {
  /// Steps times two: an address takes a number times eight at most, and three coordinates and a pad are
  /// sixteen bytes.
  Step doubled[kShortRow];
  float own;  ///< minus the number of unused steps, and of what fills up a group of the rest

  int step(int k) const { return doubled[k] / 2; }
  void set_step(int k, int step) { doubled[k] = static_cast<Step>(2 * step); }

  /// What step k leads to from *x.
  template <typename Value>
  const Value& at(const Value* x, int k) const {
    const char* const place = reinterpret_cast<const char*>(x);
    return *reinterpret_cast<const Value*>(place + std::ptrdiff_t{doubled[k]} * (sizeof(Value) / 2));
  }
};

/// All rows of a graph. Inside a lattice hardly anything is stored; elsewhere half the bytes of a list of
/// neighbors, read in strides that are known ahead.
struct ShortRows {
  std::vector<LatticeRun> runs;
  /// The rows outside runs, one after the other. One of the two is empty: the first where the steps of many
  /// rows do not fit into 16 bits.
  LargeVector<ShortRow<std::int16_t>> near;
  LargeVector<ShortRow<std::int32_t>> far;
  LargeVector<int> long_rows;     ///< ascending: the rows whose short row does not hold all neighbors
  LargeVector<int> rest_offsets;  ///< by long row and one more, into rest
  LargeVector<int> rest;  ///< their other neighbors, and the row itself up to a multiple of kRestGroup

  bool empty() const { return runs.empty() && near.empty() && far.empty(); }
  std::size_t bytes() const;

  /// Position in long_rows of the first one that is not before `row`.
  int first_long_from(int row) const {
    return static_cast<int>(std::lower_bound(long_rows.begin(), long_rows.end(), row) - long_rows.begin());
  }
};

/// The graph's rows. `neighbors` ascend.
ShortRows short_rows(std::span<const int> offsets, std::span<const int> neighbors,
                     std::span<const float> diagonal, ThreadTeam& team);

}  // namespace sinew
