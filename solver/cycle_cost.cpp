#include "solver/cycle_cost.h"

#include "solver/cycle.h"

namespace sinew {
namespace {

constexpr std::int64_t kRow = 4 * sizeof(float);  // x y z and a pad
constexpr std::int64_t kLanes = 4;
constexpr std::int64_t kIndex = sizeof(int);
constexpr std::int64_t kNumber = sizeof(float);
constexpr std::int64_t kCorners = 8;

// Trilinear weights applied to one row, and the other way round: as restrict_piece and interpolate_piece do.
constexpr std::int64_t kRestrictOperations = 15;
constexpr std::int64_t kInterpolateOperations = 14;
constexpr std::int64_t kPieceOperations = 11;

// Eight others, what two rows share, the two beside a row, and its own equation.
constexpr std::int64_t kRunRowOperations = 14;

CycleCost operator+(const CycleCost& a, const CycleCost& b) {
  return {a.bytes + b.bytes, a.operations + b.operations};
}
CycleCost operator*(std::int64_t times, const CycleCost& cost) {
  return {times * cost.bytes, times * cost.operations};
}

// A pass over the rows of A that reads b and x and writes a row: a sweep or a residual.
CycleCost matrix_pass(const LevelMatrix& A) {
  const std::int64_t n = A.size();
  const std::int64_t entries = A.entries();
  const bool uniform = A.weights.empty();
  if (const ShortRows& rows = A.short_rows; !rows.empty()) {
    // Unused steps are read and added too.
    const auto rest = static_cast<std::int64_t>(rows.rest.size());
    const std::int64_t in_runs = row_count(rows.runs), loose = n - in_runs;
    return {static_cast<std::int64_t>(rows.bytes()) + loose * kNumber + n * 3 * kRow,
            kLanes * (in_runs * kRunRowOperations + loose * (kShortRow + 5) + rest)};
  }
  return {entries * (kIndex + (uniform ? 0 : kNumber)) + n * (kIndex + kNumber + 3 * kRow),
          kLanes * (entries * (uniform ? 1 : 2) + n * (uniform ? 3 : 2))};
}

CycleCost clear(const LevelMatrix& A) {
  return {A.size() * kRow, 0};
}

CycleCost restrict_values(const Transfer& transfer) {
  if (transfer.rows) {
    const RowTransfer& P = *transfer.rows;
    const auto entries = static_cast<std::int64_t>(P.values.size()),
               n = static_cast<std::int64_t>(P.own_share.size());
    return {entries * (kIndex + kNumber) + n * kRow + P.coarse_count * (kIndex + kRow), kLanes * 2 * entries};
  }
  const PieceTransfer& P = *transfer.pieces;
  const auto n = static_cast<std::int64_t>(P.nodes.size()), uses = static_cast<std::int64_t>(P.uses.size());
  const std::int64_t pieces = P.piece_count();
  const CycleCost sums = {n * (kIndex + 3 * kNumber + kRow) + pieces * (kIndex + kCorners * kRow),
                          kLanes * kRestrictOperations * n};
  const CycleCost gather = {uses * (kIndex + kRow) + P.coarse_count * (kIndex + kRow), kLanes * uses};
  return sums + gather;
}

// `reads`: rows read and written at every fine node, besides the coarse ones.
CycleCost interpolate_values(const Transfer& transfer, std::int64_t reads) {
  if (transfer.rows) {
    const RowTransfer& P = *transfer.rows;
    const auto entries = static_cast<std::int64_t>(P.values.size()),
               n = static_cast<std::int64_t>(P.own_share.size());
    return {
        entries * (kIndex + kNumber) + n * (kIndex + kNumber + (reads + 1) * kRow) + P.coarse_count * kRow,
        kLanes * (2 * entries + n * (reads + 1))};
  }
  const PieceTransfer& P = *transfer.pieces;
  const auto n = static_cast<std::int64_t>(P.nodes.size());
  const std::int64_t pieces = P.piece_count();
  return {
      n * (kIndex + 3 * kNumber + reads * kRow) + pieces * kIndex * (1 + kCorners) + P.coarse_count * kRow,
      kLanes * (n * (kInterpolateOperations + reads - 1) + pieces * kPieceOperations)};
}

// Residuals of the patches' nodes, their factors down and up, and the step.
CycleCost solve_patches(const std::vector<Patch>& patches) {
  CycleCost cost;
  for (const Patch& patch : patches) {
    const std::int64_t n = patch.size();
    const auto neighbors = static_cast<std::int64_t>(patch.neighbors.size());
    const auto factor = static_cast<std::int64_t>(patch.factor.bytes());
    cost =
        cost + CycleCost{static_cast<std::int64_t>(patch.bytes()) + factor + neighbors * kRow + 8 * n * kRow,
                         kLanes * (2 * neighbors + 4 * patch.factor.entries() + 5 * n)};
  }
  return cost;
}

class Counter {
 public:
  Counter(const Hierarchy::Members& hierarchy, int sweeps) : hierarchy_(hierarchy), sweeps_(sweeps) {}

  CycleCost v_cycle() const {
    return last() == 0 ? last_level() : clear(hierarchy_.matrices[0]) + improve(0);
  }

  CycleCost full_cycle(Reach reach) const {
    CycleCost cost = last_level();
    for (int level = 0; level < last(); ++level) {
      const Transfer& transfer = hierarchy_.transfers[level];
      cost = cost + restrict_values(transfer) + interpolate_values(transfer, 1);
      cost = cost + (reach == Reach::far && finished_by_smoothing(hierarchy_, level)
                         ? 2 * kFinishingSweeps * matrix_pass(hierarchy_.matrices[level]) +
                               solve_patches(hierarchy_.patches)
                         : improve(level));
    }
    return cost;
  }

 private:
  int last() const { return static_cast<int>(hierarchy_.matrices.size()) - 1; }

  CycleCost improve(int level) const {
    const Transfer& transfer = hierarchy_.transfers[level];
    const std::int64_t passes = 2 * sweeps_on_level(hierarchy_, level, sweeps_) + 1;
    const CycleCost patches = level == 0 ? solve_patches(hierarchy_.patches) : CycleCost{};
    return patches + passes * matrix_pass(hierarchy_.matrices[level]) + restrict_values(transfer) +
           clear(hierarchy_.matrices[level + 1]) + interpolate_values(transfer, 2) +
           (level + 1 == last() ? last_level() : improve(level + 1));
  }

  CycleCost last_level() const {
    const LevelMatrix& A = hierarchy_.matrices.back();
    if (!hierarchy_.bottom) return clear(A) + 2 * kLastLevelSweeps * matrix_pass(A);
    // Both triangles are one array, read twice; the rows are permuted, solved down and up, permuted back.
    const auto bytes = static_cast<std::int64_t>(hierarchy_.bottom->bytes());
    const std::int64_t n = A.size();
    return {2 * bytes + 6 * n * kRow, kLanes * (4 * hierarchy_.bottom->entries() + n)};
  }

  const Hierarchy::Members& hierarchy_;
  int sweeps_;
};

}  // namespace

CycleCost cycle_cost(const Hierarchy::Members& hierarchy, int sweeps, Reach reach) {
  const Counter counter(hierarchy, sweeps);
  return reach == Reach::near || reach == Reach::light ? counter.v_cycle() : counter.full_cycle(reach);
}

}  // namespace sinew
