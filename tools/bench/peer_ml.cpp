// The only file that includes Trilinos ML: its C interface, so no other part of Trilinos is needed.
// [Gee et al. 2006: ML 5.0 Smoothed Aggregation User's Guide]
#include <ml_include.h>
#include <mpi.h>

#include <algorithm>

#include "tools/bench/peer.h"

namespace sinew {
namespace {

constexpr int kMostLevels = 20;
constexpr int kCoarsest = 1000;  ///< nodes that are solved directly

/// The rows that ML asks for, one or several at a time. Returns 0 when they do not fit.
int copy_rows(ML_Operator* operator_of, int count, int* rows, int space, int* columns, double* values,
              int* lengths) {
  const auto& A = *static_cast<const SparseMatrix*>(ML_Get_MyGetrowData(operator_of));
  int used = 0;
  for (int k = 0; k < count; ++k) {
    const int begin = A.outerIndexPtr()[rows[k]];
    lengths[k] = A.outerIndexPtr()[rows[k] + 1] - begin;
    if (used + lengths[k] > space) return 0;
    std::copy_n(A.innerIndexPtr() + begin, lengths[k], columns + used);
    std::copy_n(A.valuePtr() + begin, lengths[k], values + used);
    used += lengths[k];
  }
  return 1;
}

int multiply(ML_Operator* operator_of, int, double* x, int, double* y) {
  const auto& A = *static_cast<const SparseMatrix*>(ML_Get_MyMatvecData(operator_of));
  Eigen::Map<Field>(y, A.rows()).noalias() = A * Eigen::Map<const Field>(x, A.cols());
  return 0;
}

class MlPeer : public Peer {
 public:
  MlPeer() { MPI_Init(nullptr, nullptr); }
  ~MlPeer() override {
    tear_down();
    MPI_Finalize();
  }
  MlPeer(const MlPeer&) = delete;
  MlPeer& operator=(const MlPeer&) = delete;

  void load(const PosedSystem& posed) override {
    A_ = matrix(posed.system);
    b_ = posed.b;
    x_.setZero(posed.size(), 3);
  }
  void set_up() override {
    const int n = static_cast<int>(A_.rows());
    ML_Set_PrintLevel(0);
    ML_Create(&multigrid_, kMostLevels);
    ML_Init_Amatrix(multigrid_, 0, n, n, &A_);
    ML_Set_Amatrix_Getrow(multigrid_, 0, copy_rows, nullptr, n);
    ML_Set_Amatrix_Matvec(multigrid_, 0, multiply);
    ML_Aggregate_Create(&aggregates_);
    ML_Aggregate_Set_MaxCoarseSize(aggregates_, kCoarsest);
    const int levels = ML_Gen_MGHierarchy_UsingAggregation(multigrid_, 0, ML_INCREASING, aggregates_);
    for (int level = 0; level + 1 < levels; ++level) {
      ML_Gen_Smoother_SymGaussSeidel(multigrid_, level, ML_BOTH, 1, 1.0);
    }
    ML_Gen_Smoother_Amesos(multigrid_, levels - 1, ML_AMESOS_KLU, -1, 0.0, 1);
    ML_Gen_Solver(multigrid_, ML_MGV, 0, levels - 1);
    for (Field* field : {&r_, &z_, &p_, &Ap_, &solution_}) field->setZero(n);
  }
  void tear_down() override {
    if (multigrid_ == nullptr) return;
    ML_Aggregate_Destroy(&aggregates_);
    ML_Destroy(&multigrid_);
    multigrid_ = nullptr;
  }
  int solve(double tolerance) override {
    int most = 0;
    for (int column = 0; column < 3; ++column) {
      most = std::max(most, solve_column(column, tolerance));
      x_.col(column) = solution_;
    }
    return most;
  }
  void answer(Columns& x) override { x = x_; }
  std::string settings() const override {
    return "ML: smoothed aggregation, symmetric Gauss-Seidel, KLU at the bottom, CG in double, one column "
           "after the "
           "other, 1 process";
  }

 private:
  /// Conjugate gradients preconditioned by one V-cycle.
  int solve_column(int column, double tolerance) {
    solution_.setZero();
    r_ = b_.col(column);
    const double goal = tolerance * r_.norm();
    double rz = 0.0;
    for (int iteration = 0; iteration < 5000; ++iteration) {
      if (r_.norm() <= goal) return iteration;
      z_.setZero();
      ML_Solve_MGV(multigrid_, r_.data(), z_.data());
      const double rz_new = r_.dot(z_);
      p_ = iteration == 0 ? z_ : Field(z_ + (rz_new / rz) * p_);
      rz = rz_new;
      Ap_.noalias() = A_ * p_;
      const double step = rz / p_.dot(Ap_);
      solution_ += step * p_;
      r_ -= step * Ap_;
    }
    return 5000;
  }

  SparseMatrix A_;
  Columns b_, x_;
  Field r_, z_, p_, Ap_, solution_;
  ML* multigrid_ = nullptr;
  ML_Aggregate* aggregates_ = nullptr;
};

}  // namespace

std::unique_ptr<Peer> make_ml_peer(int) {
  return std::make_unique<MlPeer>();
}

}  // namespace sinew
