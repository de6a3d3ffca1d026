// Rows inside a lattice, which keep no lists of neighbors.
#include "solver/lattice_runs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <vector>

#include "graphs.h"
#include "solver/cholesky.h"
#include "solver/hierarchy_levels.h"
#include "solver/lanes.h"
#include "solver/multigrid.h"
#include "solver/row_passes.h"

namespace sinew {
namespace {

graphs::Problem ball_along_lines(int nodes) {
  return graphs::bent(graphs::bcc_ball(nodes), graphs::Order::as_made);
}

std::vector<LatticeRun> runs_of(const Graph& graph, const std::function<bool(int, int)>& alike) {
  return lattice_runs(graph.offsets, graph.neighbors, alike);
}
bool always(int, int) {
  return true;
}

TEST(LatticeRuns, hold_the_inside_of_a_body_and_say_what_the_graph_says) {
  const Graph graph = ball_along_lines(20000).system.graph;
  const int n = graph.node_count();
  const std::vector<LatticeRun> runs = runs_of(graph, always);
  int inside = 0, before = 0, last = 0;
  for (int i = 0; i < n; ++i) inside += graph.offsets[i + 1] - graph.offsets[i] == 14 ? 1 : 0;
  for (const LatticeRun& run : runs) {
    EXPECT_GE(run.first, last);
    EXPECT_GE(run.count, 4);
    EXPECT_EQ(run.before, before);
    last = run.end();
    before += run.count;
    for (int i = run.first; i < run.end(); ++i) {
      const auto neighbors = run.neighbors(i);
      ASSERT_EQ(std::vector<int>(neighbors.begin(), neighbors.end()),
                std::vector<int>(graph.neighbors.begin() + graph.offsets[i],
                                 graph.neighbors.begin() + graph.offsets[i + 1]));
    }
  }
  EXPECT_EQ(row_count(runs), before);
  EXPECT_GT(before, 0.9 * inside);
}

TEST(LatticeRuns, end_where_a_row_is_not_like_the_first) {
  const Graph graph = ball_along_lines(20000).system.graph;
  const std::vector<LatticeRun> whole = runs_of(graph, always);
  const LatticeRun& cut = *std::max_element(whole.begin(), whole.end(),
                                            [](const auto& a, const auto& b) { return a.count < b.count; });
  ASSERT_GE(cut.count, 9);
  const int other = cut.first + 4;
  const auto runs = runs_of(graph, [&](int first, int row) { return (first == other) == (row == other); });
  EXPECT_EQ(row_count(runs), row_count(whole) - 1);
  const LatticeRun& first = runs[first_run_behind(runs, cut.first)];
  EXPECT_EQ(first.first, cut.first);
  EXPECT_EQ(first.count, 4);
  EXPECT_TRUE(runs_of(graph, [](int, int) { return false; }).empty());
}

TEST(LatticeRuns, of_short_rows_have_one_diagonal) {
  const Graph graph = ball_along_lines(20000).system.graph;
  ThreadTeam team(1);
  std::vector<float> diagonal(graph.node_count(), 14.0f);
  const std::vector<LatticeRun> whole = short_rows(graph.offsets, graph.neighbors, diagonal, team).runs;
  diagonal[whole.front().first + 1] = 15.0f;
  EXPECT_LT(row_count(short_rows(graph.offsets, graph.neighbors, diagonal, team).runs), row_count(whole));
}

TEST(LatticeRuns, parts_cover_every_range_once_in_order) {
  std::vector<LatticeRun> runs = {{3, 4, 0}, {7, 5, 4}, {20, 6, 9}};
  const int n = 30;
  for (int begin = 0; begin < n; ++begin) {
    for (int end = begin + 1; end <= n; ++end) {
      std::vector<int> up, down;
      ascend_parts(
          runs, begin, end,
          [&](int first, int last, int before) {
            for (int i = first; i < last; ++i) {
              up.push_back(i);
              int counted = 0;
              for (const LatticeRun& run : runs) {
                EXPECT_FALSE(run.first <= i && i < run.end()) << i;
                counted += run.end() <= i ? run.count : 0;
              }
              EXPECT_EQ(before, counted);
            }
          },
          [&](const LatticeRun& run, int first, int last) {
            EXPECT_LT(first, last);
            EXPECT_TRUE(run.first <= first && last <= run.end());
            for (int i = first; i < last; ++i) up.push_back(i);
          });
      descend_parts(
          runs, begin, end,
          [&](int first, int last, int before) {
            int counted = 0;
            for (const LatticeRun& run : runs) counted += run.end() <= first ? run.count : 0;
            EXPECT_EQ(before, counted);
            for (int i = last; i > first; --i) down.push_back(i - 1);
          },
          [&](const LatticeRun& run, int first, int last) {
            EXPECT_LT(first, last);
            EXPECT_TRUE(run.first <= first && last <= run.end());
            for (int i = last; i > first; --i) down.push_back(i - 1);
          });
      std::vector<int> wanted;
      for (int i = begin; i < end; ++i) wanted.push_back(i);
      EXPECT_EQ(up, wanted) << begin << " to " << end;
      std::reverse(wanted.begin(), wanted.end());
      EXPECT_EQ(down, wanted) << begin << " to " << end;
    }
  }
}

// Rows of numbers side by side; standard containers do not align them.
template <int kWidth>
struct SideBySide {
  using Float = typename Lanes<kWidth>::Float;
  explicit SideBySide(int n) : memory(n * sizeof(Float)), rows(memory.as<Float>()), count(n) {}
  SideBySide(const SideBySide& other) : SideBySide(other.count) { std::copy_n(other.rows, count, rows); }

  AlignedMemory memory;
  Float* rows;
  int count;
};

// x_i of Gauss-Seidel on row i, and the row's residual, in double.
struct Row {
  double relaxed, residual;
};
template <typename Float>
Row row_of(const LinearSystem& system, const Float* b, const Float* x, int i, int lane) {
  const Graph& graph = system.graph;
  double sum = b[i][lane], diagonal = system.anchor[i];
  for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
    sum += graph.weights[k] * static_cast<double>(x[graph.neighbors[k]][lane]);
    diagonal += graph.weights[k];
  }
  return {sum / diagonal, sum - diagonal * static_cast<double>(x[i][lane])};
}

template <int kWidth>
void passes_agree_with_rows_one_by_one() {
  const LinearSystem system = ball_along_lines(6000).system;
  ThreadTeam team(1);
  const Hierarchy hierarchy(system, {.coarsest_size = 500}, team);
  const LevelMatrix& A = hierarchy.members().matrices.front();
  ASSERT_GT(row_count(A.short_rows.runs), A.size() / 4);
  const int n = A.size(), begin = n / 5 + 1, end = 4 * n / 5 + 1;
  const SideBySide<kWidth> b(n), x(n), r(n);
  for (int i = 0; i < n; ++i) {
    for (int lane = 0; lane < kWidth; ++lane) {
      b.rows[i][lane] = static_cast<float>((7 * i + 3 * lane) % 11) - 5.0f;
      x.rows[i][lane] = static_cast<float>((5 * i + lane) % 13) / 6.0f - 1.0f;
    }
  }
  const SideBySide<kWidth> forward = x, backward = x, wanted_forward = x, wanted_backward = x;
  const RowPasses<kWidth>& passes = row_passes<kWidth>(A);
  passes.residual(A, b.rows, x.rows, r.rows, begin, end);
  passes.forward(A, b.rows, forward.rows, begin, end);
  passes.backward(A, b.rows, backward.rows, begin, end);
  const auto relax = [&](int i, int lane, const SideBySide<kWidth>& rows) {
    rows.rows[i][lane] = static_cast<float>(row_of(system, b.rows, rows.rows, i, lane).relaxed);
  };
  for (int lane = 0; lane < kWidth; ++lane) {
    for (int i = begin; i < end; ++i) {
      ASSERT_NEAR(r.rows[i][lane], row_of(system, b.rows, x.rows, i, lane).residual, 1e-4) << "row " << i;
      relax(i, lane, wanted_forward);
    }
    for (int i = end - 1; i >= begin; --i) relax(i, lane, wanted_backward);
    for (int i = 0; i < n; ++i) {
      ASSERT_NEAR(forward.rows[i][lane], wanted_forward.rows[i][lane], 1e-5) << "row " << i;
      ASSERT_NEAR(backward.rows[i][lane], wanted_backward.rows[i][lane], 1e-5) << "row " << i;
    }
  }
}

TEST(LatticeRuns, passes_agree_with_rows_one_by_one) {
  passes_agree_with_rows_one_by_one<4>();
  passes_agree_with_rows_one_by_one<8>();
  passes_agree_with_rows_one_by_one<16>();
}

TEST(LatticeRuns, solves_end_at_the_direct_answer_and_a_constant_is_none) {
  const graphs::Problem problem = ball_along_lines(20000);
  ThreadTeam team(2);
  const MultigridSolver solver(problem.system, {}, team);
  const int n = problem.system.graph.node_count();
  Columns direct(n, 3), x = Columns::Zero(n, 3);
  const CholeskySolver cholesky(problem.system);
  cholesky.solve(problem.b, direct, {}, *cholesky.make_workspace(3));
  const SolveReport report =
      solver.solve(problem.b, x, {.tolerance = 1e-10, .from_zero = true}, *solver.make_workspace(3));
  EXPECT_TRUE(report.converged);
  EXPECT_LT((x - direct).norm(), 1e-9 * direct.norm());

  // Every node at one place, far away: what its anchors want of it is all there is to say, to the last bit.
  const Columns far = Columns::Constant(n, 3, 1e6);
  Columns wanted(n, 3);
  for (int column = 0; column < 3; ++column) wanted.col(column) = 1e6 * problem.system.anchor;
  Columns same = far;
  const SolveReport constant =
      solver.solve(wanted, same, {.tolerance = 0.0, .max_cycles = 0}, *solver.make_workspace(3));
  EXPECT_EQ(constant.residual, 0.0);
}

}  // namespace
}  // namespace sinew
