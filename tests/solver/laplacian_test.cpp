#include "solver/laplacian.h"

#include <gtest/gtest.h>

#include "graphs.h"
#include "refusal.h"

namespace sinew {
namespace {

Graph weighted_triangle_with_a_tail() {
  const std::vector<Edge> edges = {{0, 1, 2.0}, {1, 2, 3.0}, {2, 0, 0.5}, {2, 3, 1.5}};
  return make_graph(4, edges);
}

TEST(Laplacian, constants_are_in_the_null_space) {
  const SparseMatrix L = laplacian(graphs::bcc_ball(3000).graph);
  EXPECT_EQ((L * Field::Constant(L.cols(), 7.25)).norm(), 0.0);
}

TEST(Laplacian, is_symmetric_with_the_weights_off_the_diagonal) {
  const Eigen::MatrixXd L = laplacian(weighted_triangle_with_a_tail());
  EXPECT_EQ((L - L.transpose()).norm(), 0.0);
  EXPECT_EQ(L(1, 2), -3.0);
  EXPECT_EQ(L(0, 3), 0.0);
  EXPECT_EQ(L(2, 2), 5.0);
}

TEST(Laplacian, energy_is_the_weighted_sum_of_squared_differences) {
  const SparseMatrix L = laplacian(weighted_triangle_with_a_tail());
  Field x(4);
  x << 1, -2, 0.5, 4;
  const double energy = 2.0 * 9 + 3.0 * 6.25 + 0.5 * 0.25 + 1.5 * 12.25;
  EXPECT_NEAR(x.dot(L * x), energy, 1e-12);
}

TEST(LinearSystem, the_matrix_adds_the_anchor_to_the_diagonal) {
  LinearSystem system;
  system.graph = weighted_triangle_with_a_tail();
  system.anchor = Field::Zero(4);
  system.anchor[3] = 2.5;
  const Eigen::MatrixXd difference =
      Eigen::MatrixXd(matrix(system)) - Eigen::MatrixXd(laplacian(system.graph));
  EXPECT_EQ(difference, Eigen::MatrixXd(system.anchor.asDiagonal()));
  system.anchor.resize(3);
  EXPECT_EQ(refusal([&] { matrix(system); }), "matrix: anchor has 3 entries; expected 4");
}

TEST(LinearSystem, names_the_components_that_nothing_holds) {
  LinearSystem system;
  const std::vector<Edge> edges = {{0, 1}, {2, 3}, {4, 5}};
  system.graph = make_graph(6, edges);
  system.anchor = Field::Zero(6);
  system.anchor[3] = 1;
  const Components components = connected_components(system.graph);
  EXPECT_EQ(unanchored_components(system, components), (std::vector<int>{0, 2}));
  system.anchor[0] = system.anchor[5] = 1;
  EXPECT_TRUE(unanchored_components(system, components).empty());
}

TEST(LinearSystem, the_residual_agrees_with_the_matrix_for_any_number_of_columns) {
  LinearSystem system = graphs::bent(graphs::bcc_dumbbell(2000)).system;
  for (std::size_t k = 0; k < system.graph.weights.size(); ++k)
    system.graph.weights[k] = 1.0 + 0.001 * static_cast<double>(k % 7);
  const SparseMatrix A = matrix(system);
  for (int columns : {1, 2, 3, 4, 5, 7, 12}) {
    const Columns b = Columns::Random(A.rows(), columns), x = Columns::Random(A.rows(), columns);
    Columns r;
    residual(system, b, x, r);
    EXPECT_LT((r - (b - A * x)).norm(), 1e-10 * b.norm()) << columns << " columns";
  }
}

TEST(LinearSystem, the_residual_refuses_shapes_that_do_not_fit) {
  const LinearSystem system = graphs::bent(graphs::path(10)).system;
  Columns r;
  EXPECT_EQ(refusal([&] { residual(system, Columns::Zero(7, 3), Columns::Zero(8, 3), r); }),
            "residual: b is 7 x 3; expected 8 x 3");
  EXPECT_EQ(refusal([&] { residual(system, Columns::Zero(8, 3), Columns::Zero(8, 2), r); }),
            "residual: x is 8 x 2; expected 8 x 3");
}

}  // namespace
}  // namespace sinew
