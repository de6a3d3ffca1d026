#pragma once

#include <string>
#include <vector>

#include "tools/bench/frames_bench.h"
#include "tools/bench/solver_report.h"
#include "tools/bench/table.h"

/// What `sinew bench frames` measured, for people and for programs.
namespace sinew {

/// Which body, clip and frames, on which machine, in one line.
std::string frames_line(const FramesBenchResult& result);

/// Stages and whole frames in milliseconds; CHOLMOD beside them; targets.
std::vector<Table> frames_tables(const FramesBenchResult& result);

/// `read_bandwidth_gbs`, `frame.{median_ms,p95_ms,p99_ms,cholesky_median_ms}`, `stages.NAME` and more.
std::string frames_json(const FramesBenchResult& result);

/// What a comparison found, a line each.
std::vector<std::string> comparison_lines(const Comparison& comparison, double max_slowdown);

}  // namespace sinew
