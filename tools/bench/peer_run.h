#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace sinew {

/// How far a solver is asked to go, and what it took.
struct PeerSolve {
  double tolerance = 0.0;  ///< of the relative residual, worst of three columns
  double seconds = 0.0;    ///< median
  double least_seconds = 0.0;
  int iterations = 0;         ///< cycles or iterations; 0 for a direct solver
  double residual = 0.0;      ///< true, in double
  double vertex_error = 0.0;  ///< largest, as a share of the body's diagonal
  bool reached = false;       ///< residual <= tolerance
};

/// What one solver measured on one system, or why it has no numbers.
struct PeerResult {
  double setup_s = 0.0;    ///< median
  double memory_mb = 0.0;  ///< resident growth by set-up and first solve, by the system's account; 10^6 bytes
  double peak_mb = 0.0;    ///< the most it grew by meanwhile
  double solver_mb =
      0.0;  ///< what the solver says the prepared hierarchy or factor holds; 0: it does not say
  std::vector<PeerSolve> solves;          ///< one a tolerance asked for
  std::map<std::string, double> figures;  ///< what else it measured of itself: "v_cycle_s", "f_cycle_s", ...
  std::string settings;
  std::string failure;  ///< "not finished: ..."; empty when all went well

  bool finished() const { return failure.empty(); }
  /// The solve for `tolerance`, or nullptr.
  const PeerSolve* at(double tolerance) const;
};

struct PeerLimits {
  int threads = 1;
  int repeats = 5;
  double seconds = 600.0;      ///< of one solver on one system
  double megabytes = 20000.0;  ///< its address space
};

/// The solvers that the program sinew-bench-peer beside this one knows. Throws UnusableInput when it is not
/// there.
std::vector<std::string> peers_at_hand();

/// The medians of several rounds of one solver on one system, of which the first is taken for what does not
/// vary; of rounds that failed, the first.
PeerResult median_of(const std::vector<PeerResult>& rounds);

/// Runs one of them in a process of its own on the system in `file`. Throws UnusableInput when the program is
/// not there; whatever else goes wrong is the result's failure.
PeerResult run_peer(const std::string& solver, const std::filesystem::path& file,
                    const std::vector<double>& tolerances, const PeerLimits& limits);

}  // namespace sinew
