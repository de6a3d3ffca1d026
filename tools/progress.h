#pragma once

#include <chrono>
#include <string>

#include "tools/commands.h"

namespace sinew {

/// Tells a person, on standard error, how far a run is. A bar only on a terminal; plain lines every
/// tenth of the way elsewhere; JSON lines for programs.
class Progress {
 public:
  Progress(ProgressStyle style, bool quiet);
  ~Progress() { finish(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// A stage that has no measure of its own begins.
  void stage(const std::string& name);
  /// `done` of `total` steps of the current stage are finished.
  void step(int done, int total);
  /// The run is over: an open bar goes away.
  void finish() { clear_line(); }

 private:
  void clear_line();

  ProgressStyle style_;
  std::string stage_;
  int last_tenth_ = -1;
  bool line_open_ = false;
  std::chrono::steady_clock::time_point last_drawn_{};
};

}  // namespace sinew
