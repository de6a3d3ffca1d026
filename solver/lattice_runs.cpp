#include "solver/lattice_runs.h"

#include <algorithm>

namespace sinew {
namespace {

/// Rows that a run needs to be worth the reading of its steps.
constexpr int kFewestRows = 4;

/// The steps of row i, which has as many neighbors as a lattice node: whether it is one.
bool read_steps(int i, const int* neighbors, LatticeRun& run) {
  const auto step = [&](int k) { return neighbors[k] - i; };
  if (step(6) != -1 || step(7) != 1) return false;
  run.singles = {step(0), step(5), step(8), step(13)};
  run.pairs = {step(1), step(3), step(9), step(11)};
  return step(2) == run.pairs[0] + 1 && step(4) == run.pairs[1] + 1 && step(10) == run.pairs[2] + 1 &&
         step(12) == run.pairs[3] + 1;
}

}  // namespace

std::array<int, kLatticeNeighbors> LatticeRun::neighbors(int row) const {
  const auto [s0, s1, s2, s3] = singles;
  const auto [p0, p1, p2, p3] = pairs;
  std::array<int, kLatticeNeighbors> all = {s0, p0, p0 + 1, p1,     p1 + 1, s1,     -1,
                                            1,  s2, p2,     p2 + 1, p3,     p3 + 1, s3};
  for (int& neighbor : all) neighbor += row;
  return all;
}

std::vector<LatticeRun> lattice_runs(std::span<const int> offsets, std::span<const int> neighbors,
                                     const std::function<bool(int, int)>& alike) {
  std::vector<LatticeRun> runs;
  LatticeRun open;
  int before = 0;
  const auto close = [&] {
    if (open.count >= kFewestRows) {
      open.before = before;
      before += open.count;
      runs.push_back(open);
    }
    open.count = 0;
  };
  const int n = static_cast<int>(offsets.size()) - 1;
  for (int i = 0; i < n; ++i) {
    LatticeRun row{i, 1};
    if (offsets[i + 1] - offsets[i] != kLatticeNeighbors || !read_steps(i, &neighbors[offsets[i]], row)) {
      close();
      continue;
    }
    if (open.count > 0 && row.singles == open.singles && row.pairs == open.pairs && alike(open.first, i)) {
      ++open.count;
      continue;
    }
    close();
    if (alike(i, i)) open = row;
  }
  close();
  return runs;
}

int first_run_behind(const std::vector<LatticeRun>& runs, int row) {
  return static_cast<int>(std::partition_point(runs.begin(), runs.end(),
                                               [row](const LatticeRun& run) { return run.end() <= row; }) -
                          runs.begin());
}

}  // namespace sinew
