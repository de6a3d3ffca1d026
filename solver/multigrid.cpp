// Multigrid in single precision inside iterative refinement in double [Wilkinson 1963], with flexible
// conjugate gradients around the cycles [Notay 2000].
#include "solver/multigrid.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "solver/cycle.h"
#include "solver/cycle_cost.h"
#include "solver/edge_descent.h"
#include "solver/hierarchy_levels.h"
#include "solver/solve_checks.h"
#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

constexpr int kRowsPerBlock = 4096;

/// Numbers a loop over the nodes may sum up.
constexpr int kSums = 3;

// Largest errors left, in terms of what a part of the cycle moved. Measured over clips of fast motion: after
// full multigrid up to 1.2 of all that the finest level moved, and foretold by 1.5 of what its forward sweeps
// moved (mostly a third of that); where a V-cycle ended it, 0.86 of what came behind the forward sweeps
// (mostly 0.5: that says most).
constexpr double kErrorLeftFar = 0.6;
constexpr double kErrorLeftForeseen = 0.75;
constexpr double kErrorLeftWhole = 0.6;

// The same after a V-cycle, where each node's move counts for what such a cycle keeps of errors there: up to
// 2.4 (mostly 1.2), and 2.2 (1.6) behind another cycle; of a light one up to 4.9 (1.8), 5.6 (2.9) behind
// another. Without the nodes' shares the largest were 2.8 to 3 times what is usual.
constexpr double kErrorLeftNear = 1.45;
constexpr double kErrorLeftFurther = 1.7;
constexpr double kErrorLeftLight = 3.3;
constexpr double kErrorLeftFurtherLight = 4.0;

// What a cycle keeps of an error where that was not tried.
constexpr float kKeptUnknown = 0.2f * kKeptUnits;

// What the coarsest level's factor in single precision may leave of a correction: no smoother sees it.
constexpr double kSinglePrecision = 1e-5;

// What rounding of the correction itself leaves, however many cycles follow.
constexpr double kSingleRounding = 1e-6;

// The finest matrix in double, on the index arrays of the hierarchy's finest level.
struct FineSystem {
  const LevelMatrix* structure = nullptr;
  std::vector<double> weights;  // empty when all equal uniform_weight
  double uniform_weight = 0;
  Field anchor;
};

struct MultigridWorkspace : SolverWorkspace {
  MultigridWorkspace(const Hierarchy& made_for, int column_count)
      : hierarchy(&made_for), columns(column_count), cycle(made_for.members(), lanes_for(column_count)) {
    const int n = made_for.members().matrices.front().size();
    const auto row = static_cast<std::size_t>(lanes_for(column_count));
    residual = AlignedMemory(static_cast<std::size_t>(n) * row * sizeof(double));
    direction = AlignedMemory(static_cast<std::size_t>(n) * row * sizeof(double));
    image = AlignedMemory(static_cast<std::size_t>(n) * row * sizeof(double));
    new_image = AlignedMemory(static_cast<std::size_t>(n) * row * sizeof(double));
    block_sums = AlignedMemory(static_cast<std::size_t>(even_block_count(n, kRowsPerBlock)) * kSums * row *
                               sizeof(double));
  }
  const Hierarchy* hierarchy;
  int columns;
  CycleMemory cycle;
  AlignedMemory residual;   // n rows, double
  AlignedMemory direction;  // n rows, double
  AlignedMemory image;      // A direction: n rows, double
  AlignedMemory new_image;  // A times the last cycle's answer: n rows, double
  AlignedMemory block_sums;

  // For solve_edge_targets.
  Columns right_hand_side;
  std::optional<EdgeMemory> edges;
};

// Square lengths of the longest row; of the longest step, which is the difference from `before` or, without
// that, the row; and of the step of which a cycle keeps most.
struct Longest {
  float row = 0;
  float step = 0;
  float kept = 0;
};

struct CorrectionCycle : CorrectionWorkspace {
  explicit CorrectionCycle(const Hierarchy& made_for)
      : hierarchy(&made_for), memory(made_for.members(), lanes_for(3)) {
    const CycleMemory::Level& finest = memory.levels.front();
    const auto n = static_cast<std::size_t>(made_for.members().matrices.front().size());
    residual = {finest.b.as<Eigen::Vector4f>(), n};
    correction = {finest.x.as<Eigen::Vector4f>(), n};
    kept = AlignedMemory(n * sizeof(Eigen::Vector4f));
    of_blocks.resize(even_block_count(static_cast<int>(n), kRowsPerBlock));
  }
  const Hierarchy* hierarchy;
  CycleMemory memory;
  AlignedMemory kept;  // n rows
  std::vector<Longest> of_blocks;
};

// The correction as it is now, for longest_rows to compare with.
const Eigen::Vector4f* keep(ThreadTeam& team, CorrectionCycle& own) {
  auto* const kept = own.kept.as<Eigen::Vector4f>();
  for_runs(team, static_cast<int>(own.correction.size()), kRowsPerBlock, [&](int begin, int end) {
    std::copy(own.correction.begin() + begin, own.correction.begin() + end, kept + begin);
  });
  return kept;
}

Longest longest_rows(ThreadTeam& team, CorrectionCycle& own, const Eigen::Vector4f* before) {
  const std::span<const Eigen::Vector4f> rows = own.correction;
  const LargeVector<KeptShare>& shares = own.hierarchy->members().kept;
  const int n = static_cast<int>(rows.size()), blocks = static_cast<int>(own.of_blocks.size());
  // Written so that what is not a number passes for large.
  const auto raise = [](float& largest, float square) { largest = square <= largest ? largest : square; };
  team.for_each_block(blocks, [&](int block) {
    Longest longest;
    for (int i = even_block_begin(n, blocks, block); i < even_block_begin(n, blocks, block + 1); ++i) {
      const float row = rows[i].squaredNorm();
      const float step = before ? (rows[i] - before[i]).squaredNorm() : row;
      const float share = shares.empty() ? kKeptUnknown : static_cast<float>(shares[i]);
      raise(longest.row, row);
      raise(longest.step, step);
      raise(longest.kept, share * share * step);
    }
    own.of_blocks[block] = longest;
  });
  Longest all;
  for (const Longest& longest : own.of_blocks) {
    raise(all.row, longest.row);
    raise(all.step, longest.step);
    raise(all.kept, longest.kept);
  }
  all.kept /= kKeptUnits * kKeptUnits;
  return all;
}

// Solves for up to kWidth columns of b and x, beginning with column `first`. Lanes beyond the last
// column hold zeros and stay zero.
template <int kWidth>
class GroupSolve {
 public:
  using Float = typename Lanes<kWidth>::Float;
  using Double = typename Lanes<kWidth>::Double;

  GroupSolve(const FineSystem& system, const Hierarchy::Members& hierarchy, const MultigridOptions& options,
             ThreadTeam& team, MultigridWorkspace& workspace, const Eigen::Ref<const Columns>& b,
             Eigen::Ref<Columns>& x, int first)
      : system_(system),
        structure_(*system.structure),
        options_(options),
        team_(team),
        cycle_(hierarchy, options.smoothing_sweeps, team, workspace.cycle),
        n_(structure_.size()),
        blocks_(even_block_count(n_, kRowsPerBlock)),
        width_(std::min(kWidth, static_cast<int>(b.cols()) - first)),
        b_(b.data() + first),
        b_stride_(b.outerStride()),
        x_(x.data() + first),
        x_stride_(x.outerStride()),
        residual_(workspace.residual.as<Double>()),
        direction_(workspace.direction.as<Double>()),
        image_(workspace.image.as<Double>()),
        new_image_(workspace.new_image.as<Double>()),
        block_sums_(workspace.block_sums.as<Double>()) {}

  SolveReport run(const SolveOptions& options) {
    return run(options, [](Cycle<kWidth>& cycle) { cycle.full_cycle(); });
  }

  template <typename FirstCycle>
  SolveReport run(const SolveOptions& options, const FirstCycle& first_cycle) {
    begin(options.from_zero);
    SolveReport report;
    report.residual = worst_residual();
    while (report.residual > options.tolerance && report.cycles < options.max_cycles) {
      const bool full = report.cycles == 0 && (options.from_zero || options.full_first_cycle);
      if (full)
        first_cycle(cycle_);
      else
        cycle_.v_cycle();
      // Full multigrid hits the right length by itself, and a step of conjugate gradients costs two passes.
      if (full || !options_.conjugate_gradients)
        add_correction();
      else
        step_along_direction();
      ++report.cycles;
      report.residual = worst_residual();
    }
    if (x_is_unset_) clear_x();
    report.converged = report.residual <= options.tolerance;
    if (report.cycles > 0) report.largest_change = largest_change();
    return report;
  }

 private:
  struct Sums {
    Double of[kSums] = {};

    Double& operator[](int k) { return of[k]; }
    const Double& operator[](int k) const { return of[k]; }
  };

  // Runs body(begin, end, sums) over fixed blocks of nodes, each with sums of its own, and adds the sums
  // up in the order of the blocks.
  template <typename Body>
  Sums sum_over_nodes(const Body& body) {
    team_.for_each_block(blocks_, [&](int block) {
      Sums sums;
      body(even_block_begin(n_, blocks_, block), even_block_begin(n_, blocks_, block + 1), sums);
      std::copy(sums.of, sums.of + kSums, block_sums_ + kSums * block);
    });
    Sums total;
    for (int block = 0; block < blocks_; ++block)
      for (int k = 0; k < kSums; ++k) total[k] += block_sums_[kSums * block + k];
    return total;
  }

  // Three columns are the common case, and worth telling the compiler.
  Double load(const double* row) const {
    Double value{};
    if constexpr (kWidth == 4)
      if (width_ == 3) {
        value[0] = row[0];
        value[1] = row[1];
        value[2] = row[2];
        return value;
      }
    for (int c = 0; c < width_; ++c) value[c] = row[c];
    return value;
  }
  void store(const Double& value, double* row) const {
    if constexpr (kWidth == 4)
      if (width_ == 3) {
        row[0] = value[0];
        row[1] = value[1];
        row[2] = value[2];
        return;
      }
    for (int c = 0; c < width_; ++c) row[c] = value[c];
  }
  double* x_row(int i) const { return x_ + i * x_stride_; }

  void keep_residual(int i, const Double& value) {
    residual_[i] = value;
    cycle_.right_hand_side()[i] = converted<float, kWidth>(value);
  }

  // Sum of v_i - v_j over the neighbors j of a row outside runs. `long_row`: the next one among the long
  // rows.
  template <typename Row, typename At>
  Double differences(int i, const Row& row, int& long_row, const Double& own, const At& at) const {
    const ShortRows& rows = structure_.short_rows;
    Double sum{};
    for (int k = 0; k < kShortRow; ++k) sum += own - at(i + row.step(k));
    if (long_row == static_cast<int>(rows.long_rows.size()) || rows.long_rows[long_row] != i) return sum;
    for (int k = rows.rest_offsets[long_row]; k < rows.rest_offsets[long_row + 1]; ++k)
      sum += own - at(rows.rest[k]);
    ++long_row;
    return sum;
  }
  // The same along the list of neighbors, weighted.
  template <typename At>
  Double weighted_differences(int i, const Double& own, const At& at) const {
    Double sum{};
    const int begin = structure_.offsets[i], end = structure_.offsets[i + 1];
    if (!system_.weights.empty()) {
      for (int k = begin; k < end; ++k) sum += system_.weights[k] * (own - at(structure_.neighbors[k]));
      return sum;
    }
    for (int k = begin; k < end; ++k) sum += own - at(structure_.neighbors[k]);
    return sum * system_.uniform_weight;
  }

  // Calls body(i, v_i, (A v)_i) for rows [begin, end), `at(j)` giving v_j in double. Differences first: the
  // constants cancel exactly.
  template <typename At, typename Body>
  void for_each_image(int begin, int end, const At& at, const Body& body) const {
    const ShortRows& rows = structure_.short_rows;
    const double weight = system_.uniform_weight;
    const auto finish = [&](int i, const Double& own, const Double& sum) {
      body(i, own, sum + system_.anchor[i] * own);
    };
    if (rows.empty()) {
      for (int i = begin; i < end; ++i) {
        const Double own = at(i);
        finish(i, own, weighted_differences(i, own, at));
      }
      return;
    }
    int long_row = rows.first_long_from(begin);
    ascend_parts(
        rows.runs, begin, end,
        [&](int first, int last, int before) {
          for (int i = first; i < last; ++i) {
            const Double own = at(i);
            const Double sum = rows.far.empty() ? differences(i, rows.near[i - before], long_row, own, at)
                                                : differences(i, rows.far[i - before], long_row, own, at);
            finish(i, own, weight * sum);
          }
        },
        [&](const LatticeRun& run, int first, int last) {
          along_run<1>(run, first, last, at, [&](int i, const Double& pairs, const Double& singles) {
            const Double own = at(i);
            const Double along = 2.0 * own - (at(i - 1) + at(i + 1));
            finish(i, own, weight * ((8.0 * own - pairs) + (4.0 * own - singles) + along));
          });
        });
  }

  // From zero the residual is b and x is not read: neither is written before the first correction.
  void begin(bool from_zero) {
    x_is_unset_ = from_zero;
    const auto sums = sum_over_nodes([&](int begin, int end, auto& partial) {
      for (int i = begin; i < end; ++i) {
        const Double b = load(b_ + i * b_stride_);
        partial[0] += b * b;
        if (from_zero) cycle_.right_hand_side()[i] = converted<float, kWidth>(b);
      }
      if (from_zero) return;
      for_each_image(
          begin, end, [&](int j) { return load(x_row(j)); },
          [&](int i, const Double&, const Double& image) {
            const Double r = load(b_ + i * b_stride_) - image;
            partial[1] += r * r;
            keep_residual(i, r);
          });
    });
    size_ = sums[0];
    residual_size_ = from_zero ? sums[0] : sums[1];
    if (!from_zero) forget_zero_columns();
  }

  void clear_x() {
    for (int i = 0; i < n_; ++i) store(Double{}, x_row(i));
  }

  // A x = 0 has the answer 0; no residual could be measured against it.
  void forget_zero_columns() {
    for (int c = 0; c < width_; ++c) {
      if (size_[c] != 0 || residual_size_[c] == 0) continue;
      for (int i = 0; i < n_; ++i) {
        x_row(i)[c] = 0;
        Double r = residual_[i];
        r[c] = 0;
        keep_residual(i, r);
      }
      residual_size_[c] = 0;
    }
  }

  // What is not a number must not pass for small.
  double worst_residual() const {
    double worst = 0;
    for (int c = 0; c < width_; ++c) {
      const double relative = size_[c] != 0 ? std::sqrt(residual_size_[c] / size_[c]) : 0.0;
      if (std::isnan(relative)) return relative;
      worst = std::max(worst, relative);
    }
    return worst;
  }

  // Of the step just taken. The last vector a step moves along is still there, so the maximum can wait
  // until it is asked for.
  double largest_change() {
    const auto moved = [this, z = cycle_.solution()](int i) {
      return has_direction_ ? direction_[i] : converted<double, kWidth>(z[i]);
    };
    team_.for_each_block(blocks_, [&](int block) {
      Double largest{};
      const int end = even_block_begin(n_, blocks_, block + 1);
      for (int i = even_block_begin(n_, blocks_, block); i < end; ++i) {
        largest = larger(absolute(moved(i)), largest);
      }
      block_sums_[kSums * block] = largest;
    });
    double largest = 0;
    for (int block = 0; block < blocks_; ++block)
      for (int c = 0; c < width_; ++c)
        largest =
            std::max(largest, block_sums_[kSums * block][c] * std::abs(has_direction_ ? step_[c] : 1.0));
    return largest;
  }

  // x += e, r -= A e.
  void add_correction() {
    const Float* const e = cycle_.solution();
    const bool fresh = x_is_unset_;
    residual_size_ = sum_over_nodes([&](int begin, int end, auto& partial) {
      for_each_image(
          begin, end, [&](int j) { return converted<double, kWidth>(e[j]); },
          [&](int i, const Double& own, const Double& image) {
            const Double r = (fresh ? load(b_ + i * b_stride_) : residual_[i]) - image;
            store(fresh ? own : load(x_row(i)) + own, x_row(i));
            partial[0] += r * r;
            keep_residual(i, r);
          });
    })[0];
    x_is_unset_ = false;
  }

  // One step of conjugate gradients: the cycle's answer z, made A-orthogonal to the last direction p, with
  // the length that leaves the smallest error in the energy norm. A is linear, so A times the new direction
  // z + share p needs no pass of its own: one pass forms A z and all products, another moves everything.
  void step_along_direction() {
    if (!has_direction_) forget_direction();
    const Float* const z = cycle_.solution();
    const auto products = sum_over_nodes([&](int begin, int end, auto& partial) {
      for_each_image(
          begin, end, [&](int j) { return converted<double, kWidth>(z[j]); },
          [&](int i, const Double& own, const Double& Az) {
            new_image_[i] = Az;
            partial[0] += own * Az;
            partial[1] += own * residual_[i];
            partial[2] += own * image_[i];
          });
    });
    Double share{};
    for (int c = 0; c < width_; ++c) {
      share[c] = energy_[c] > 0 ? -products[2][c] / energy_[c] : 0.0;
      // The residual is orthogonal to p since the step along it.
      energy_[c] = products[0][c] + 2 * share[c] * products[2][c] + share[c] * share[c] * energy_[c];
      step_[c] = energy_[c] > 0 ? products[1][c] / energy_[c] : 0.0;
    }
    move_along(z, share);
  }

  void forget_direction() {
    has_direction_ = true;
    energy_ = Double{};
    team_.for_each_block(blocks_, [&](int block) {
      const int begin = even_block_begin(n_, blocks_, block), end = even_block_begin(n_, blocks_, block + 1);
      std::fill(direction_ + begin, direction_ + end, Double{});
      std::fill(image_ + begin, image_ + end, Double{});
    });
  }

  // p <- z + share p, x += step p, r -= step A p.
  void move_along(const Float* z, const Double& share) {
    const Double step = step_;
    residual_size_ = sum_over_nodes([&](int begin, int end, auto& partial) {
      for (int i = begin; i < end; ++i) {
        const Double p = converted<double, kWidth>(z[i]) + share * direction_[i];
        const Double Ap = new_image_[i] + share * image_[i];
        direction_[i] = p;
        image_[i] = Ap;
        store(load(x_row(i)) + step * p, x_row(i));
        const Double r = residual_[i] - step * Ap;
        partial[0] += r * r;
        keep_residual(i, r);
      }
    })[0];
  }

  const FineSystem& system_;
  const LevelMatrix& structure_;
  const MultigridOptions& options_;
  ThreadTeam& team_;
  Cycle<kWidth> cycle_;
  int n_, blocks_, width_;
  const double* b_;
  Eigen::Index b_stride_;
  double* x_;
  Eigen::Index x_stride_;
  Double* residual_;
  Double* direction_;
  Double* image_;
  Double* new_image_;
  Double* block_sums_;
  Double size_{}, residual_size_{}, energy_{}, step_{};
  bool x_is_unset_ = false;
  bool has_direction_ = false;
};

FineSystem fine_system(const LinearSystem& system, const LevelMatrix& structure) {
  FineSystem fine;
  fine.structure = &structure;
  fine.anchor = system.anchor;
  const std::vector<double>& weights = system.graph.weights;
  if (structure.weights.empty())
    fine.uniform_weight = weights.empty() ? 0 : weights.front();
  else
    fine.weights = weights;
  return fine;
}

int sweeps_for(const MultigridOptions& options, Reach reach) {
  return reach == Reach::light ? (options.smoothing_sweeps + 1) / 2 : options.smoothing_sweeps;
}

const LinearSystem& checked(const LinearSystem& system) {
  check_system("MultigridSolver", system);
  return system;
}

}  // namespace

struct MultigridSolver::Members {
  Members(const LinearSystem& linear_system, const MultigridOptions& multigrid_options,
          ThreadTeam& borrowed_team)
      : options(multigrid_options),
        team(borrowed_team),
        hierarchy(checked(linear_system), multigrid_options.hierarchy, borrowed_team),
        system(fine_system(linear_system, hierarchy.members().matrices.front())) {}

  template <int kWidth>
  SolveReport solve_group(const Eigen::Ref<const Columns>& b, Eigen::Ref<Columns>& x, int first,
                          const SolveOptions& solve_options, MultigridWorkspace& workspace) const {
    return GroupSolve<kWidth>(system, hierarchy.members(), options, team, workspace, b, x, first)
        .run(solve_options);
  }

  CorrectionCycle& checked_correction(CorrectionWorkspace& workspace) const {
    auto* const own = dynamic_cast<CorrectionCycle*>(&workspace);
    if (own == nullptr || own->hierarchy != &hierarchy) refuse_correction_workspace("MultigridSolver");
    return *own;
  }
  Cycle<4> correction_cycle(Reach reach, CorrectionCycle& own) const {
    return {hierarchy.members(), sweeps_for(options, reach), team, own.memory};
  }

  // b = beta + sum of w * wanted.
  void sum_targets(const EdgeTargets& targets, Columns& b) const {
    const LevelMatrix& structure = *system.structure;
    if (targets.wanted.rows() != structure.entries() || targets.beta.rows() != structure.size())
      throw std::invalid_argument(
          "MultigridSolver::solve_edge_targets: " + std::to_string(targets.wanted.rows()) +
          " edge rows and " + std::to_string(targets.beta.rows()) + " beta rows; expected " +
          std::to_string(structure.entries()) + " and " + std::to_string(structure.size()));
    for_items(team, structure.size(), kRowsPerBlock, [&](int i) {
      Eigen::RowVector3d sum = targets.beta.row(i);
      for (int k = structure.offsets[i]; k < structure.offsets[i + 1]; ++k)
        sum += (system.weights.empty() ? system.uniform_weight : system.weights[k]) * targets.wanted.row(k);
      b.row(i) = sum;
    });
  }

  MultigridOptions options;
  ThreadTeam& team;
  Hierarchy hierarchy;
  FineSystem system;
};

MultigridSolver::MultigridSolver(const LinearSystem& system, const MultigridOptions& options,
                                 ThreadTeam& team)
    : members_(std::make_unique<Members>(system, options, team)) {
  if (options.smoothing_sweeps < 1)
    throw std::invalid_argument("MultigridSolver: smoothing_sweeps is " +
                                std::to_string(options.smoothing_sweeps) + "; expected at least 1");
}

MultigridSolver::~MultigridSolver() = default;

std::unique_ptr<SolverWorkspace> MultigridSolver::make_workspace(int columns) const {
  check_workspace_columns("MultigridSolver", columns);
  return std::make_unique<MultigridWorkspace>(members_->hierarchy, columns);
}

SolveReport MultigridSolver::solve(const Eigen::Ref<const Columns>& b, Eigen::Ref<Columns> x,
                                   const SolveOptions& options, SolverWorkspace& workspace) const {
  auto& own = workspace_of<MultigridWorkspace>("MultigridSolver", workspace);
  if (own.hierarchy != &members_->hierarchy)
    throw std::invalid_argument("MultigridSolver::solve: the workspace was made by another solver");
  check_shapes("MultigridSolver", size(), own.columns, b, x);
  SolveReport report;
  report.converged = true;
  for (int first = 0; first < b.cols();) {
    const int width = lanes_for(static_cast<int>(b.cols()) - first);
    const SolveReport group = width == 4   ? members_->solve_group<4>(b, x, first, options, own)
                              : width == 8 ? members_->solve_group<8>(b, x, first, options, own)
                                           : members_->solve_group<16>(b, x, first, options, own);
    report.cycles = std::max(report.cycles, group.cycles);
    if (!(group.residual <= report.residual)) report.residual = group.residual;  // not a number stays
    report.converged = report.converged && group.converged;
    report.largest_change = std::max(report.largest_change, group.largest_change);
    first += width;
  }
  return report;
}

std::unique_ptr<CorrectionWorkspace> MultigridSolver::make_correction_workspace() const {
  return std::make_unique<CorrectionCycle>(members_->hierarchy);
}

CorrectionReport MultigridSolver::correct(Reach reach, double enough, CorrectionWorkspace& workspace) const {
  CorrectionCycle& own = members_->checked_correction(workspace);
  Cycle<4> cycle = members_->correction_cycle(reach, own);
  if (reach == Reach::near || reach == Reach::light) {
    cycle.v_cycle();
    const Longest longest = longest_rows(members_->team, own, nullptr);
    return {1, reach, (reach == Reach::light ? kErrorLeftLight : kErrorLeftNear) * std::sqrt(longest.kept),
            kSingleRounding * std::sqrt(longest.row)};
  }
  cycle.descend();
  const Eigen::Vector4f* const before = keep(members_->team, own);
  const auto report = [&](double share) -> CorrectionReport {
    const Longest longest = longest_rows(members_->team, own, before);
    const double row = std::sqrt(longest.row);
    const int cycles = reach == Reach::whole ? 2 : 1;
    return {cycles, reach, share * std::sqrt(longest.step) + kSinglePrecision * row, kSingleRounding * row};
  };
  if (!cycle.finishes_by_smoothing()) {
    cycle.finish();
    return report(kErrorLeftFar);
  }
  cycle.begin_finish();
  if (reach == Reach::far) {
    if (report(kErrorLeftForeseen).error_left <= enough) {
      cycle.finish_by_smoothing();
      return report(kErrorLeftFar);
    }
    reach = Reach::whole;
  }
  keep(members_->team, own);
  cycle.improve_smoothed(0);
  return report(kErrorLeftWhole);
}

CorrectionReport MultigridSolver::correct_further(Reach reach, CorrectionWorkspace& workspace) const {
  CorrectionCycle& own = members_->checked_correction(workspace);
  Cycle<4> cycle = members_->correction_cycle(reach, own);
  const Eigen::Vector4f* const before = keep(members_->team, own);
  cycle.further_v_cycle();
  const Longest longest = longest_rows(members_->team, own, before);
  const double rounding = kSingleRounding * std::sqrt(longest.row);
  const double left = reach == Reach::light ? kErrorLeftFurtherLight : kErrorLeftFurther;
  return {1, reach, left * std::sqrt(longest.kept) + rounding, rounding};
}

CycleCost MultigridSolver::correction_cost(Reach reach) const {
  return cycle_cost(members_->hierarchy.members(), sweeps_for(members_->options, reach), reach);
}

std::unique_ptr<SolverWorkspace> MultigridSolver::make_edge_workspace() const {
  auto workspace = std::make_unique<MultigridWorkspace>(members_->hierarchy, 3);
  workspace->right_hand_side.resize(size(), 3);
  workspace->edges.emplace(members_->hierarchy.members());
  return workspace;
}

SolveReport MultigridSolver::solve_edge_targets(const EdgeTargets& targets, Eigen::Ref<Columns> x,
                                                const SolveOptions& options,
                                                SolverWorkspace& workspace) const {
  auto& own = workspace_of<MultigridWorkspace>("MultigridSolver", workspace);
  if (own.hierarchy != &members_->hierarchy || !own.edges)
    throw std::invalid_argument(
        "MultigridSolver::solve_edge_targets: the workspace was not made by make_edge_workspace of this "
        "solver");
  members_->sum_targets(targets, own.right_hand_side);
  const Hierarchy::Members& levels = members_->hierarchy.members();
  if (levels.descents.empty() || !options.from_zero) return solve(own.right_hand_side, x, options, workspace);
  check_shapes("MultigridSolver", size(), own.columns, own.right_hand_side, x);
  const Eigen::Ref<const Columns> b = own.right_hand_side;
  return GroupSolve<4>(members_->system, levels, members_->options, members_->team, own, b, x, 0)
      .run(options, [&](Cycle<4>& cycle) {
        full_cycle_along_edges(levels, targets, members_->team, *own.edges, cycle);
      });
}

std::string MultigridSolver::name() const {
  return members_->options.hierarchy.coarsening == Coarsening::lattice ? "multigrid" : "multigrid-shi2006";
}

int MultigridSolver::size() const {
  return members_->system.structure->size();
}

std::size_t MultigridSolver::bytes() const {
  return members_->hierarchy.bytes() + bytes_of(members_->system.weights) +
         static_cast<std::size_t>(size()) * sizeof(double);
}

const Hierarchy& MultigridSolver::hierarchy() const {
  return members_->hierarchy;
}

}  // namespace sinew
