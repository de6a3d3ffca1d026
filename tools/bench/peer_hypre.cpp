// The only file that includes Hypre and MPI. [Henson, Yang 2002: BoomerAMG]
#include <HYPRE.h>
#include <HYPRE_IJ_mv.h>
#include <HYPRE_krylov.h>
#include <HYPRE_parcsr_ls.h>
#include <mpi.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "tools/bench/peer.h"

namespace sinew {
namespace {

/// Hypre's codes. PMIS and extended+i interpolation cut to four entries a row keep the hierarchy lean;
/// forward sweeps down and backward sweeps up keep the cycle symmetric, as CG needs it.
constexpr HYPRE_Int kPmis = 8;
constexpr HYPRE_Int kExtendedI = 6;
constexpr HYPRE_Int kForward = 13, kBackward = 14;
constexpr double kStrong = 0.25;

class HyprePeer : public Peer {
 public:
  HyprePeer() {
    MPI_Init(nullptr, nullptr);
    HYPRE_Init();
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks_);
  }
  ~HyprePeer() override {
    tear_down();
    for (int column = 0; column < 3; ++column) {
      HYPRE_IJVectorDestroy(b_[column]);
      HYPRE_IJVectorDestroy(x_[column]);
    }
    HYPRE_IJMatrixDestroy(A_);
    HYPRE_Finalize();
    MPI_Finalize();
  }
  HyprePeer(const HyprePeer&) = delete;
  HyprePeer& operator=(const HyprePeer&) = delete;

  void load(const PosedSystem& posed) override {
    n_ = posed.size();
    for (int rank = 0; rank <= ranks_; ++rank) {
      first_of_rank_.push_back(static_cast<int>(static_cast<std::int64_t>(n_) * rank / ranks_));
    }
    rows_.resize(static_cast<std::size_t>(end() - begin()));
    std::iota(rows_.begin(), rows_.end(), begin());
    load_matrix(matrix(posed.system));
    for (int column = 0; column < 3; ++column) {
      const Field b = posed.b.col(column).segment(begin(), end() - begin());
      b_[column] = make_vector(b);
      x_[column] = make_vector(Field::Zero(b.size()));
    }
  }

  void set_up() override {
    HYPRE_BoomerAMGCreate(&multigrid_);
    HYPRE_BoomerAMGSetCoarsenType(multigrid_, kPmis);
    HYPRE_BoomerAMGSetInterpType(multigrid_, kExtendedI);
    HYPRE_BoomerAMGSetPMaxElmts(multigrid_, 4);
    HYPRE_BoomerAMGSetStrongThreshold(multigrid_, kStrong);
    HYPRE_BoomerAMGSetCycleRelaxType(multigrid_, kForward, 1);
    HYPRE_BoomerAMGSetCycleRelaxType(multigrid_, kBackward, 2);
    HYPRE_BoomerAMGSetMaxIter(multigrid_, 1);
    HYPRE_BoomerAMGSetTol(multigrid_, 0.0);
    HYPRE_ParCSRPCGCreate(MPI_COMM_WORLD, &krylov_);
    HYPRE_PCGSetTwoNorm(krylov_, 1);
    HYPRE_PCGSetMaxIter(krylov_, 5000);
    HYPRE_PCGSetPrecond(krylov_, reinterpret_cast<HYPRE_PtrToSolverFcn>(HYPRE_BoomerAMGSolve),
                        reinterpret_cast<HYPRE_PtrToSolverFcn>(HYPRE_BoomerAMGSetup), multigrid_);
    HYPRE_ParCSRPCGSetup(krylov_, parallel_matrix(), parallel(b_[0]), parallel(x_[0]));
  }
  void tear_down() override {
    if (krylov_ == nullptr) return;
    HYPRE_ParCSRPCGDestroy(krylov_);
    HYPRE_BoomerAMGDestroy(multigrid_);
    krylov_ = multigrid_ = nullptr;
  }
  int solve(double tolerance) override {
    HYPRE_PCGSetTol(krylov_, tolerance);
    HYPRE_Int most = 0;
    for (int column = 0; column < 3; ++column) {
      HYPRE_ParVectorSetConstantValues(parallel(x_[column]), 0.0);
      HYPRE_ParCSRPCGSolve(krylov_, parallel_matrix(), parallel(b_[column]), parallel(x_[column]));
      HYPRE_Int iterations = 0;
      HYPRE_PCGGetNumIterations(krylov_, &iterations);
      most = std::max(most, iterations);
    }
    return most;
  }
  void answer(Columns& x) override {
    x.resize(n_, 3);
    std::vector<int> counts;
    for (int rank = 0; rank < ranks_; ++rank)
      counts.push_back(first_of_rank_[rank + 1] - first_of_rank_[rank]);
    Field own(end() - begin()), all(n_);
    for (int column = 0; column < 3; ++column) {
      HYPRE_IJVectorGetValues(x_[column], static_cast<HYPRE_Int>(rows_.size()), rows_.data(), own.data());
      MPI_Allgatherv(own.data(), static_cast<int>(own.size()), MPI_DOUBLE, all.data(), counts.data(),
                     first_of_rank_.data(), MPI_DOUBLE, MPI_COMM_WORLD);
      x.col(column) = all;
    }
  }
  std::string settings() const override {
    return "BoomerAMG: PMIS, extended+i interpolation of 4 entries a row, strong threshold 0.25, "
           "l1-Gauss-Seidel, "
           "CG in double, one column after the other, " +
           std::to_string(ranks_) + " MPI ranks";
  }
  double largest(double value) override { return reduced(value, MPI_MAX); }
  double sum(double value) override { return reduced(value, MPI_SUM); }
  bool reports() const override { return rank_ == 0; }

 private:
  int begin() const { return first_of_rank_[rank_]; }
  int end() const { return first_of_rank_[rank_ + 1]; }

  static double reduced(double value, MPI_Op operation) {
    double result = 0.0;
    MPI_Allreduce(&value, &result, 1, MPI_DOUBLE, operation, MPI_COMM_WORLD);
    return result;
  }

  void load_matrix(const SparseMatrix& A) {
    HYPRE_IJMatrixCreate(MPI_COMM_WORLD, begin(), end() - 1, begin(), end() - 1, &A_);
    HYPRE_IJMatrixSetObjectType(A_, HYPRE_PARCSR);
    std::vector<HYPRE_Int> counts;
    for (int row = begin(); row < end(); ++row)
      counts.push_back(A.outerIndexPtr()[row + 1] - A.outerIndexPtr()[row]);
    HYPRE_IJMatrixSetRowSizes(A_, counts.data());
    HYPRE_IJMatrixInitialize(A_);
    const int first = A.outerIndexPtr()[begin()];
    HYPRE_IJMatrixSetValues(A_, static_cast<HYPRE_Int>(rows_.size()), counts.data(), rows_.data(),
                            A.innerIndexPtr() + first, A.valuePtr() + first);
    HYPRE_IJMatrixAssemble(A_);
  }

  HYPRE_IJVector make_vector(const Field& values) const {
    HYPRE_IJVector vector = nullptr;
    HYPRE_IJVectorCreate(MPI_COMM_WORLD, begin(), end() - 1, &vector);
    HYPRE_IJVectorSetObjectType(vector, HYPRE_PARCSR);
    HYPRE_IJVectorInitialize(vector);
    HYPRE_IJVectorSetValues(vector, static_cast<HYPRE_Int>(rows_.size()), rows_.data(), values.data());
    HYPRE_IJVectorAssemble(vector);
    return vector;
  }

  HYPRE_ParCSRMatrix parallel_matrix() const {
    void* object = nullptr;
    HYPRE_IJMatrixGetObject(A_, &object);
    return static_cast<HYPRE_ParCSRMatrix>(object);
  }
  static HYPRE_ParVector parallel(HYPRE_IJVector vector) {
    void* object = nullptr;
    HYPRE_IJVectorGetObject(vector, &object);
    return static_cast<HYPRE_ParVector>(object);
  }

  int rank_ = 0, ranks_ = 1, n_ = 0;
  std::vector<int> first_of_rank_;  ///< ranks + 1
  std::vector<HYPRE_BigInt> rows_;  ///< this rank's
  HYPRE_IJMatrix A_ = nullptr;
  HYPRE_IJVector b_[3] = {}, x_[3] = {};
  HYPRE_Solver multigrid_ = nullptr, krylov_ = nullptr;
};

}  // namespace

std::unique_ptr<Peer> make_hypre_peer(int) {
  return std::make_unique<HyprePeer>();
}

}  // namespace sinew
