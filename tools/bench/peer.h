#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tools/bench/posed_system.h"

/// The solvers that are compared, each behind this interface in a .cpp of its own. They run in a process
/// of their own (peer_program.cpp): so the operating system can account for their memory, and neither
/// their licences, their MPI and OpenMP state nor their crashes reach the main program.
namespace sinew {

class Peer {
 public:
  virtual ~Peer() = default;

  /// Copies the matrix into the solver's own format. Not timed. `posed` outlives the peer.
  virtual void load(const PosedSystem& posed) = 0;

  /// What depends on the matrix alone: hierarchy, factor, workspace. Called again, it begins anew.
  virtual void set_up() = 0;

  /// Forgets what set_up() made.
  virtual void tear_down() = 0;

  /// Solves for the three columns of b from zero to a relative residual of `tolerance` by the solver's
  /// own account. Returns its iterations, the most of the columns; 0 for a direct solver.
  virtual int solve(double tolerance) = 0;

  /// The answer of the last solve, n x 3. Not timed.
  virtual void answer(Columns& x) = 0;

  /// The settings in a few words, for the reader of the table.
  virtual std::string settings() const = 0;

  /// Bytes that the prepared solver says it holds; 0 where it does not say.
  virtual std::size_t bytes() const { return 0; }

  /// What else is worth knowing of the prepared solver, measured on demand: name and value.
  virtual std::vector<std::pair<std::string, double>> figures() { return {}; }

  /// For solvers that run in several processes: the largest and the sum of a number over all of them, and
  /// whether this is the one that reports.
  virtual double largest(double value) { return value; }
  virtual double sum(double value) { return value; }
  virtual bool reports() const { return true; }
};

struct PeerKind {
  const char* name;  ///< as in the tables' files: "cholmod", "hypre", ...
  std::unique_ptr<Peer> (*make)(int threads);
};

/// Those that were found when this was configured, ours first.
std::span<const PeerKind> peer_kinds();

std::unique_ptr<Peer> make_sinew_peer(int threads);
std::unique_ptr<Peer> make_shi2006_peer(int threads);
std::unique_ptr<Peer> make_cholmod_peer(int threads);
std::unique_ptr<Peer> make_eigen_peer(int threads);
std::unique_ptr<Peer> make_amgcl_peer(int threads);
std::unique_ptr<Peer> make_hypre_peer(int threads);
std::unique_ptr<Peer> make_ml_peer(int threads);

}  // namespace sinew
