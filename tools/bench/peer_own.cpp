// The solvers of solver/ as peers: ours, Shi 2006's hierarchy, CHOLMOD and Eigen's conjugate gradients.
#include <algorithm>
#include <chrono>
#include <limits>

#include "solver/cholesky.h"
#include "solver/conjugate_gradients.h"
#include "solver/multigrid.h"
#include "tools/bench/peer.h"

namespace sinew {
namespace {

/// Conjugate gradients on millions of nodes take hundreds of iterations.
constexpr int kMostIterations = 5000;

constexpr int kCycleRepeats = 31;

/// Any LinearSolver.
template <typename Solver>
class OwnPeer : public Peer {
 public:
  void load(const PosedSystem& posed) override {
    posed_ = &posed;
    x_.setZero(posed.size(), 3);
  }
  void set_up() override {
    solver_ = make();
    workspace_ = solver_->make_workspace(3);
  }
  void tear_down() override {
    workspace_.reset();
    solver_.reset();
  }
  int solve(double tolerance) override {
    return solver_->solve(posed_->b, x_, options(tolerance), *workspace_).cycles;
  }
  void answer(Columns& x) override { x = x_; }
  std::size_t bytes() const override { return solver_->bytes(); }

 protected:
  virtual std::unique_ptr<Solver> make() = 0;
  static SolveOptions options(double tolerance) {
    return {.tolerance = tolerance, .max_cycles = kMostIterations, .from_zero = true};
  }

  const PosedSystem* posed_ = nullptr;
  Columns x_;
  std::unique_ptr<Solver> solver_;
  std::unique_ptr<SolverWorkspace> workspace_;
};

class SinewPeer : public OwnPeer<MultigridSolver> {
 public:
  explicit SinewPeer(int threads) : team_(threads) {}
  std::string settings() const override {
    return "lattice multigrid, single-precision cycles in double refinement, three columns at once, " +
           std::to_string(team_.thread_count()) + " threads";
  }
  /// One cycle alone, as a frame asks for it.
  std::vector<std::pair<std::string, double>> figures() override {
    const auto workspace = solver_->make_correction_workspace();
    for (int i = 0; i < posed_->size(); ++i) {
      workspace->residual[i].head<3>() = posed_->b.row(i).transpose().cast<float>();
      workspace->residual[i][3] = 0.0f;
    }
    return {{"v_cycle_s", median_seconds(Reach::near, *workspace)},
            {"f_cycle_s", median_seconds(Reach::far, *workspace)},
            {"v_cycle_bytes", static_cast<double>(solver_->correction_cost(Reach::near).bytes)},
            {"f_cycle_bytes", static_cast<double>(solver_->correction_cost(Reach::far).bytes)}};
  }

 private:
  std::unique_ptr<MultigridSolver> make() override {
    return std::make_unique<MultigridSolver>(posed_->system, MultigridOptions{}, team_);
  }
  double median_seconds(Reach reach, CorrectionWorkspace& workspace) const {
    std::vector<double> seconds(kCycleRepeats);
    for (double& one : seconds) {
      const auto start = std::chrono::steady_clock::now();
      solver_->correct(reach, std::numeric_limits<double>::infinity(), workspace);
      one = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    }
    std::nth_element(seconds.begin(), seconds.begin() + kCycleRepeats / 2, seconds.end());
    return seconds[kCycleRepeats / 2];
  }
  ThreadTeam team_;
};

/// The paper's own: full multigrid that carries the edges' targets to the coarse levels.
class Shi2006Peer : public OwnPeer<MultigridSolver> {
 public:
  explicit Shi2006Peer(int threads) : team_(threads) {}
  void load(const PosedSystem& posed) override {
    OwnPeer::load(posed);
    targets_ = edge_targets(posed);
  }
  void set_up() override {
    solver_ = make();
    workspace_ = solver_->make_edge_workspace();
  }
  int solve(double tolerance) override {
    return solver_->solve_edge_targets(targets_, x_, options(tolerance), *workspace_).cycles;
  }
  std::string settings() const override {
    return "Shi 2006: independent sets, both operator pairs, full multigrid, flexible CG, " +
           std::to_string(team_.thread_count()) + " threads";
  }

 private:
  std::unique_ptr<MultigridSolver> make() override {
    return std::make_unique<MultigridSolver>(
        posed_->system, MultigridOptions{.hierarchy = {.coarsening = Coarsening::shi2006}}, team_);
  }
  ThreadTeam team_;
  EdgeTargets targets_;
};

class CholmodPeer : public OwnPeer<CholeskySolver> {
 public:
  explicit CholmodPeer(int threads) : threads_(threads) {}
  std::string settings() const override {
    return "supernodal, the better of AMD and METIS orderings, three columns at once, BLAS on " +
           std::to_string(threads_) + " threads; its times to a tolerance are one substitution";
  }

 private:
  std::unique_ptr<CholeskySolver> make() override { return std::make_unique<CholeskySolver>(posed_->system); }
  int threads_;
};

class EigenPeer : public OwnPeer<ConjugateGradientSolver> {
 public:
  std::string settings() const override {
    return "conjugate gradients, incomplete Cholesky in AMD order, one column after the other, 1 thread";
  }

 private:
  std::unique_ptr<ConjugateGradientSolver> make() override {
    return std::make_unique<ConjugateGradientSolver>(posed_->system);
  }
};

}  // namespace

std::unique_ptr<Peer> make_sinew_peer(int threads) {
  return std::make_unique<SinewPeer>(threads);
}
std::unique_ptr<Peer> make_shi2006_peer(int threads) {
  return std::make_unique<Shi2006Peer>(threads);
}
std::unique_ptr<Peer> make_cholmod_peer(int threads) {
  return std::make_unique<CholmodPeer>(threads);
}
std::unique_ptr<Peer> make_eigen_peer(int) {
  return std::make_unique<EigenPeer>();
}

}  // namespace sinew
