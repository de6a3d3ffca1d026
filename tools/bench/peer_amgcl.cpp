// The only file that includes AMGCL (header only, MIT). [Demidov 2019: AMGCL]
#define AMGCL_NO_BOOST
#include <amgcl/adapter/crs_tuple.hpp>
#include <amgcl/amg.hpp>
#include <amgcl/backend/builtin.hpp>
#include <amgcl/coarsening/smoothed_aggregation.hpp>
#include <amgcl/relaxation/spai0.hpp>
#include <amgcl/solver/cg.hpp>

#include "tools/bench/peer.h"

namespace sinew {
namespace {

/// The preconditioner in single precision and with 32-bit indices, as small as AMGCL can have it.
using Single = amgcl::backend::builtin<float, int, int>;
using Double = amgcl::backend::builtin<double, int, int>;
using Preconditioner = amgcl::amg<Single, amgcl::coarsening::smoothed_aggregation, amgcl::relaxation::spai0>;
using Krylov = amgcl::solver::cg<Double>;

/// A node of the lattice has 14 links of equal weight, each 1/14 of the diagonal. AMGCL's default of 0.08
/// calls every one of them weak and takes several times the iterations.
constexpr float kStrong = 0.01f;

class AmgclPeer : public Peer {
 public:
  explicit AmgclPeer(int threads) : threads_(threads) {}

  void load(const PosedSystem& posed) override {
    A_ = matrix(posed.system);
    A_.makeCompressed();
    for (int column = 0; column < 3; ++column) {
      b_[column] = posed.b.col(column);
      x_[column] = Field::Zero(posed.size());
    }
  }
  void set_up() override {
    const auto n = static_cast<std::size_t>(A_.rows());
    rows_ = std::make_shared<Double::matrix>(
        std::make_tuple(n, amgcl::make_iterator_range(A_.outerIndexPtr(), A_.outerIndexPtr() + n + 1),
                        amgcl::make_iterator_range(A_.innerIndexPtr(), A_.innerIndexPtr() + A_.nonZeros()),
                        amgcl::make_iterator_range(A_.valuePtr(), A_.valuePtr() + A_.nonZeros())));
    Preconditioner::params params;
    params.coarsening.aggr.eps_strong = kStrong;
    preconditioner_ = std::make_unique<Preconditioner>(*rows_, params);
    krylov_ = std::make_unique<Krylov>(n);
    krylov_->prm.maxiter = 5000;
  }
  void tear_down() override {
    krylov_.reset();
    preconditioner_.reset();
    rows_.reset();
  }
  int solve(double tolerance) override {
    krylov_->prm.tol = tolerance;
    std::size_t iterations = 0;
    for (int column = 0; column < 3; ++column) {
      x_[column].setZero();
      auto x = amgcl::make_iterator_range(x_[column].data(), x_[column].data() + x_[column].size());
      const auto b = amgcl::make_iterator_range(b_[column].data(), b_[column].data() + b_[column].size());
      iterations = std::max(iterations, std::get<0>((*krylov_)(*rows_, *preconditioner_, b, x)));
    }
    return static_cast<int>(iterations);
  }
  void answer(Columns& x) override {
    x.resize(A_.rows(), 3);
    for (int column = 0; column < 3; ++column) x.col(column) = x_[column];
  }
  std::string settings() const override {
    return "smoothed aggregation, eps_strong 0.01, SPAI0, preconditioner in single precision with 32-bit "
           "indices, "
           "CG in double, one column after the other, OpenMP on " +
           std::to_string(threads_) + " threads";
  }

 private:
  int threads_;
  SparseMatrix A_;
  Field b_[3], x_[3];
  std::shared_ptr<Double::matrix> rows_;
  std::unique_ptr<Preconditioner> preconditioner_;
  std::unique_ptr<Krylov> krylov_;
};

}  // namespace

std::unique_ptr<Peer> make_amgcl_peer(int threads) {
  return std::make_unique<AmgclPeer>(threads);
}

}  // namespace sinew
