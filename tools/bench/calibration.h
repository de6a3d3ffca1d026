#pragma once

#include <vector>

#include "solver/thread_team.h"

namespace sinew {

/// A piece of work that has nothing to do with ours but wears the machine out in the same way: sweeps over a
/// graph of so many nodes with 14 neighbors each, four numbers a node in single precision. Run in between
/// measurements, it tells how fast the machine is just then. It never changes with the code under test.
class Calibration {
 public:
  /// `team` is borrowed.
  Calibration(int nodes, ThreadTeam& team);

  /// Seconds that a fixed number of sweeps takes now, some tens of milliseconds: the median of several tries,
  /// so that what gets in between one of them does not count.
  double seconds();

 private:
  struct alignas(16) Row {
    float number[4];
  };
  double one_try();
  void sweep(const std::vector<Row>& from, std::vector<Row>& to) const;

  ThreadTeam& team_;
  int sweeps_;
  std::vector<int> neighbors_;  ///< 14 a node
  std::vector<Row> now_, next_;
};

}  // namespace sinew
