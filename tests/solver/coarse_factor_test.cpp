#include "solver/coarse_factor.h"

#include <gtest/gtest.h>

#include <vector>

#include "graphs.h"

namespace sinew {
namespace {

struct Row {
  Lanes<4>::Float lanes{};
};

std::vector<Row> solved(const SparseMatrix& A, const std::vector<Row>& b) {
  std::vector<Row> x(b.size()), scratch(b.size());
  CoarseFactor(A).solve<4>(&b.front().lanes, &x.front().lanes, &scratch.front().lanes);
  return x;
}

SparseMatrix with_empty_rows(const SparseMatrix& A, int every) {
  std::vector<Eigen::Triplet<double>> entries;
  const auto place = [every](int row) { return row + row / (every - 1); };
  for (int row = 0; row < A.rows(); ++row)
    for (SparseMatrix::InnerIterator entry(A, row); entry; ++entry)
      entries.emplace_back(place(row), place(static_cast<int>(entry.col())), entry.value());
  SparseMatrix spread(place(static_cast<int>(A.rows())), place(static_cast<int>(A.rows())));
  spread.setFromTriplets(entries.begin(), entries.end());
  return spread;
}

std::vector<Row> some_rows(Eigen::Index count) {
  std::vector<Row> rows(count);
  for (Eigen::Index row = 0; row < count; ++row)
    for (int lane = 0; lane < 4; ++lane)
      rows[row].lanes[lane] = static_cast<float>((row * 13 + lane * 5) % 11 - 5);
  return rows;
}

TEST(CoarseFactor, rows_of_zeros_get_no_correction_and_disturb_no_other) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_ball(300));
  const SparseMatrix plain = matrix(problem.system);
  constexpr int every = 7;
  const SparseMatrix A = with_empty_rows(plain, every);
  const std::vector<Row> b = some_rows(A.rows());
  std::vector<Row> plain_b;
  for (int row = 0; row < A.rows(); ++row)
    if (row % every != every - 1) plain_b.push_back(b[row]);
  const std::vector<Row> x = solved(A, b), plain_x = solved(plain, plain_b);
  std::size_t next = 0;
  for (int row = 0; row < A.rows(); ++row) {
    const Row wanted = row % every == every - 1 ? Row{} : plain_x[next++];
    for (int lane = 0; lane < 4; ++lane) ASSERT_NEAR(x[row].lanes[lane], wanted.lanes[lane], 1e-4f) << row;
  }
}

Eigen::VectorXd lane_of(const std::vector<Row>& rows, int lane) {
  Eigen::VectorXd values(rows.size());
  for (std::size_t row = 0; row < rows.size(); ++row) values[row] = rows[row].lanes[lane];
  return values;
}

TEST(CoarseFactor, leaves_a_residual_of_single_precision) {
  const std::vector<graphs::Body> bodies = {
      graphs::bcc_ball(700), graphs::comb(20, 15), graphs::sheet(30, 12), graphs::path(200),
      graphs::star(9, 12),   graphs::hub(300),     graphs::tree(6)};
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    const SparseMatrix A = matrix(graphs::bent(bodies[k]).system);
    const std::vector<Row> b = some_rows(A.rows()), x = solved(A, b);
    for (int lane = 0; lane < 4; ++lane) {
      const Eigen::VectorXd answer = lane_of(x, lane), wanted = lane_of(b, lane);
      EXPECT_LT((A * answer - wanted).norm(), 1e-6 * (A.norm() * answer.norm() + wanted.norm()))
          << "body " << k;
    }
  }
}

// As coarse nodes with the same fine nodes do: both see half of what there is.
TEST(CoarseFactor, nodes_that_repeat_one_another_share_one_answer) {
  const SparseMatrix plain = matrix(graphs::bent(graphs::bcc_ball(300)).system);
  const auto n = static_cast<int>(plain.rows());
  std::vector<Eigen::Triplet<double>> entries;
  for (int row = 0; row < n; ++row)
    for (SparseMatrix::InnerIterator entry(plain, row); entry; ++entry)
      for (const int below : {0, n})
        for (const int beside : {0, n})
          entries.emplace_back(row + below, static_cast<int>(entry.col()) + beside, entry.value());
  SparseMatrix A(2 * n, 2 * n);
  A.setFromTriplets(entries.begin(), entries.end());
  const std::vector<Row> once = some_rows(n), wanted = solved(plain, once);
  std::vector<Row> b = once;
  b.insert(b.end(), once.begin(), once.end());
  const std::vector<Row> x = solved(A, b);
  for (int lane = 0; lane < 4; ++lane) {
    const Eigen::VectorXd both = lane_of(x, lane);
    EXPECT_LT((both.head(n) + both.tail(n) - lane_of(wanted, lane)).norm(),
              1e-4 * lane_of(wanted, lane).norm());
  }
}

}  // namespace
}  // namespace sinew
