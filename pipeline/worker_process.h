#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace sinew {

struct WorkerLimits {
  double seconds = 60.0;      ///< wall clock, and processor time as well
  double megabytes = 4096.0;  ///< address space of the worker, and the most it may write
};

struct WorkerResult {
  std::string output;  ///< all it wrote on standard output
  std::string
      failure;  ///< why the output is not to be used, as the end of "the worker ..."; empty: it exited with 0
};

/// Runs `program` without arguments, with `input` on its standard input.
///
/// Whatever the program does, this returns shortly after the time limit: the worker, and what it may
/// have started, is killed then, and it is always waited for. It dies with the calling thread. No signal
/// handler or other state of the calling process is touched. Linux.
WorkerResult run_worker(const std::string& program, std::string_view input, const WorkerLimits& limits);

}  // namespace sinew
