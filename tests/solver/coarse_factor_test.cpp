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

TEST(CoarseFactor, rows_of_zeros_get_no_correction_and_disturb_no_other) {
  const graphs::Problem problem = graphs::bent(graphs::bcc_ball(300));
  const SparseMatrix plain = matrix(problem.system);
  constexpr int every = 7;
  const SparseMatrix A = with_empty_rows(plain, every);
  std::vector<Row> b(A.rows()), plain_b;
  for (int row = 0; row < A.rows(); ++row) {
    for (int lane = 0; lane < 4; ++lane)
      b[row].lanes[lane] = static_cast<float>((row * 13 + lane * 5) % 11 - 5);
    if (row % every != every - 1) plain_b.push_back(b[row]);
  }
  const std::vector<Row> x = solved(A, b), plain_x = solved(plain, plain_b);
  std::size_t next = 0;
  for (int row = 0; row < A.rows(); ++row) {
    const Row wanted = row % every == every - 1 ? Row{} : plain_x[next++];
    for (int lane = 0; lane < 4; ++lane) ASSERT_NEAR(x[row].lanes[lane], wanted.lanes[lane], 1e-4f) << row;
  }
}

}  // namespace
}  // namespace sinew
