#include "skeleton/transform.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <numbers>

namespace sinew {
namespace {

const Eigen::Quaterniond kTurn(Eigen::AngleAxisd(0.7, Eigen::Vector3d(1.0, 2.0, -0.5).normalized()));

double distance(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) { return a.angularDistance(b); }

TEST(Transform, scales_first_then_turns_then_moves) {
  const Eigen::Quaterniond quarter(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()));
  const Transform transform{.translation = {10, 0, 0}, .rotation = quarter, .scale = {2, 3, 4}};
  EXPECT_LT((transform.matrix() * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(10, 2, 0)).norm(), 1e-14);
  EXPECT_LT((transform.matrix() * Eigen::Vector3d(0, 1, 1) - Eigen::Vector3d(7, 0, 4)).norm(), 1e-14);
}

TEST(NearestRotation, takes_a_stretch_off) {
  Eigen::Matrix3d stretch;  // symmetric and positive: what the polar decomposition splits off
  stretch << 2.0, 0.3, 0.1, 0.3, 1.0, -0.2, 0.1, -0.2, 0.5;
  EXPECT_LT(distance(nearest_rotation(kTurn.toRotationMatrix() * stretch), kTurn), 1e-7);
}

TEST(NearestRotation, does_not_depend_on_the_unit_of_length) {
  for (const double unit : {1e-6, 1.0, 1e6}) {
    EXPECT_LT(distance(nearest_rotation(unit * kTurn.toRotationMatrix()), kTurn), 1e-7);
  }
}

TEST(NearestRotation, takes_a_mirror_off_along_x) {
  const Eigen::Matrix3d mirrored = kTurn.toRotationMatrix() * Eigen::Vector3d(-1, 1, 1).asDiagonal();
  EXPECT_LT(distance(nearest_rotation(mirrored), kTurn), 1e-7);
}

TEST(NearestRotation, turns_even_where_the_matrix_flattens) {
  for (const Eigen::Vector3d& scale : {Eigen::Vector3d(1, 1, 0), Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0, 0, 0)}) {
    const Eigen::Quaterniond turn = nearest_rotation(kTurn.toRotationMatrix() * scale.asDiagonal());
    EXPECT_NEAR(turn.norm(), 1.0, 1e-12);
    EXPECT_NEAR(turn.toRotationMatrix().determinant(), 1.0, 1e-12);
  }
}

}  // namespace
}  // namespace sinew
