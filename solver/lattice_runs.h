#pragma once

#include <array>
#include <functional>
#include <span>
#include <vector>

/// Internal to solver/ and pipeline/: the rows of a graph that need no list of neighbors, because they lie
/// inside a lattice.
namespace sinew {

/// Neighbors of a node inside a body-centred lattice.
constexpr int kLatticeNeighbors = 14;

/// Rows [first, end()) of one line inside a body-centred lattice whose nodes are ordered along lines, line
/// after line and layer after layer. Each has its neighbors at the same steps: one before and one behind it
/// in its own line, one in each of four lines like its own, and two next to each other in each of the four
/// lines between those.
struct LatticeRun {
  int first = 0;
  int count = 0;
  int before = 0;                ///< rows of all runs before this one
  std::array<int, 4> singles{};  ///< steps from a row, ascending
  std::array<int, 4> pairs{};    ///< steps to the first of each two, ascending

  int end() const { return first + count; }
  /// Ascending.
  std::array<int, kLatticeNeighbors> neighbors(int row) const;
};

/// The runs of a graph, ascending. `neighbors` ascend. A row joins the run of an earlier one, or begins its
/// own, where its steps allow it and alike(first row of the run, row) says so. Shorter runs than are worth
/// their start are left out. O(entries).
std::vector<LatticeRun> lattice_runs(std::span<const int> offsets, std::span<const int> neighbors,
                                     const std::function<bool(int, int)>& alike);

/// Rows of all these runs.
inline int row_count(const std::vector<LatticeRun>& runs) {
  return runs.empty() ? 0 : runs.back().before + runs.back().count;
}

/// Position of the first run that ends behind `row`.
int first_run_behind(const std::vector<LatticeRun>& runs, int row);

/// Calls loose(begin, end, rows of runs before) and in_run(run, begin, end) for the parts of rows [begin,
/// end), ascending. `next`: first_run_behind(runs, begin), and afterwards first_run_behind(runs, end).
template <typename Loose, typename InRun>
void ascend_parts(const std::vector<LatticeRun>& runs, int begin, int end, int& next, const Loose& loose,
                  const InRun& in_run) {
  int before = next > 0 ? runs[next - 1].before + runs[next - 1].count : 0;
  for (int i = begin; i < end;) {
    const bool more = next < static_cast<int>(runs.size()) && runs[next].first < end;
    const int stop = more ? runs[next].first : end;
    if (i < stop) loose(i, stop, before);
    if (!more) return;
    const LatticeRun& run = runs[next];
    const int start = i < stop ? stop : i;
    i = run.end() < end ? run.end() : end;
    in_run(run, start, i);
    if (i < run.end()) return;
    before += run.count;
    ++next;
  }
}
template <typename Loose, typename InRun>
void ascend_parts(const std::vector<LatticeRun>& runs, int begin, int end, const Loose& loose,
                  const InRun& in_run) {
  int next = first_run_behind(runs, begin);
  ascend_parts(runs, begin, end, next, loose, in_run);
}

/// The same, descending.
template <typename Loose, typename InRun>
void descend_parts(const std::vector<LatticeRun>& runs, int begin, int end, const Loose& loose,
                   const InRun& in_run) {
  int k = first_run_behind(runs, end - 1);
  // The last run that begins before `end`.
  if (k == static_cast<int>(runs.size()) || runs[k].first >= end) --k;
  for (int i = end; i > begin; --k) {
    const bool more = k >= 0 && runs[k].end() > begin;
    const int stop = more ? runs[k].end() : begin;
    if (i > stop) loose(stop, i, k >= 0 ? runs[k].before + runs[k].count : 0);
    if (!more) return;
    const int last = i > stop ? stop : i;
    i = runs[k].first > begin ? runs[k].first : begin;
    in_run(runs[k], i, last);
  }
}

/// Calls visit(i, pairs, singles) for rows [begin, end) of a run, ascending or (kStep -1) descending:
/// sums of `at` over the eight neighbors in pairs and over the four single ones of other lines. What two rows
/// that follow each other have in common is summed once, so that a row reads eight others instead of twelve:
/// `visit` may change its own row alone. Sums of equal numbers are exact.
template <int kStep, typename At, typename Visit>
inline void along_run(const LatticeRun& run, int begin, int end, const At& at, const Visit& visit) {
  const auto [s0, s1, s2, s3] = run.singles;
  const auto [p0, p1, p2, p3] = run.pairs;
  const auto four = [&](int i) { return (at(i + p0) + at(i + p1)) + (at(i + p2) + at(i + p3)); };
  constexpr int kAhead = kStep > 0 ? 1 : 0;
  const int first = kStep > 0 ? begin : end - 1, stop = kStep > 0 ? end : begin - 1;
  auto shared = four(first + 1 - kAhead);
  for (int i = first; i != stop; i += kStep) {
    const auto next = four(i + kAhead);
    const auto pairs = shared + next;
    shared = next;
    visit(i, pairs, (at(i + s0) + at(i + s1)) + (at(i + s2) + at(i + s3)));
  }
}

}  // namespace sinew
