#include "pipeline/skinning.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>

#include "arm_rig.h"
#include "pipeline/local_step.h"
#include "pipeline/quality.h"

namespace sinew {
namespace {

class Skinning : public testing::Test {
 protected:
  ThreadTeam team_{1};
  Rig rig_ = build_rig(arm_mesh(), arm_skeleton(), arm_options(Deform::paper), team_);
  Field3 skinned(const Pose& pose, void (*skin)(const Rig&, const Pose&, Field3&)) {
    Field3 positions = rig_.volume.rest_positions;
    skin(rig_, pose, positions);
    return positions;
  }
};

TEST_F(Skinning, moving_the_whole_skeleton_moves_the_mesh_rigidly) {
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond whole = turn(200, {0, 1, 2});
  const Eigen::Vector3d shift(1, 2, 3);
  const Field3 wanted =
      (rig_.volume.rest_positions * whole.toRotationMatrix().transpose()).rowwise() + shift.transpose();
  for (const auto skin : {linear_blend_skinning, dual_quaternion_skinning}) {
    const Field3 positions = skinned(posed(rig_.skeleton, {whole, none, none}, shift), skin);
    EXPECT_LT(largest_difference(positions, wanted), 1e-6);  // weights are single precision
  }
}

TEST_F(Skinning, a_twisted_wrist_collapses_when_matrices_are_blended_and_holds_when_motions_are) {
  const QualityMeter meter(rig_);
  const Pose pose = bent_arm(0, 150);
  const int wrist = 2;
  EXPECT_LT(meter.local_volume_ratio(wrist, skinned(pose, linear_blend_skinning)), 0.8);
  EXPECT_GT(meter.local_volume_ratio(wrist, skinned(pose, dual_quaternion_skinning)), 0.9);
}

/// The fit of one neighborhood, in a lane of its own among lanes that ask something else.
Eigen::Quaternionf fitted(const Eigen::Matrix3d& sum, const Eigen::Quaterniond& start) {
  constexpr int lane = kFitLanes - 2;
  FitBatch batch{};
  for (int other = 0; other < kFitLanes; ++other) {
    batch.rotation[3][other] = 1.0f;
    for (const int diagonal : {0, 4, 8}) batch.sum[diagonal][other] = 1.0f;
  }
  for (int k = 0; k < 9; ++k) batch.sum[k][lane] = static_cast<float>(sum(k / 3, k % 3));
  for (int k = 0; k < 4; ++k) batch.rotation[k][lane] = static_cast<float>(start.coeffs()[k]);
  fit_rotations(batch);
  return Eigen::Quaternionf(batch.rotation[3][lane], batch.rotation[0][lane], batch.rotation[1][lane],
                            batch.rotation[2][lane])
      .normalized();
}

/// By singular values, in double.
Eigen::Quaterniond best_rotation(const Eigen::Matrix3d& sum, const Eigen::Quaterniond& guess) {
  const double size = sum.norm() > 0.0 ? sum.norm() : 1.0;
  const Eigen::Matrix3d all = sum / size + static_cast<double>(kGuessCounts) * guess.toRotationMatrix();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(all, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d signs(1.0, 1.0, (svd.matrixU() * svd.matrixV().transpose()).determinant());
  return Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose()));
}

double distance(const Eigen::Quaternionf& a, const Eigen::Quaterniond& b) {
  return a.cast<double>().angularDistance(b);
}

TEST(LocalStep, two_batches_at_once_find_what_each_finds_alone) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> number(-1.0f, 1.0f);
  for (const std::size_t easy : {0, 1}) {
    std::array<FitBatch, 2> both;
    for (std::size_t k = 0; k < both.size(); ++k) {
      for (auto& entry : both[k].sum)
        for (float& lane : entry) lane = number(random);
      for (auto& entry : both[k].rotation)
        for (float& lane : entry) lane = 0.1f * number(random);
      for (float& lane : both[k].rotation[3]) lane = 1.0f;
      // One batch is done after the first steps, the other one takes many.
      if (k == easy)
        for (int entry = 0; entry < 9; ++entry)
          std::fill_n(both[k].sum[entry], kFitLanes, entry % 4 == 0 ? 1.0f : 0.0f);
    }
    std::array<FitBatch, 2> alone = both;
    fit_rotations(both);
    for (std::size_t k = 0; k < both.size(); ++k) {
      fit_rotations(alone[k]);
      for (int lane = 0; lane < kFitLanes; ++lane) {
        const auto rotation = [&](const FitBatch& batch) {
          return Eigen::Quaterniond(batch.rotation[3][lane], batch.rotation[0][lane], batch.rotation[1][lane],
                                    batch.rotation[2][lane])
              .normalized();
        };
        EXPECT_LT(rotation(both[k]).angularDistance(rotation(alone[k])), 3e-6) << "batch " << k;
      }
    }
  }
}

TEST(LocalStep, the_best_rotation_is_found) {
  const Eigen::Matrix3d spread = 1e-6 * Eigen::Vector3d(1.0, 0.5, 0.2).asDiagonal();
  for (const double degrees : {0.0, 1.0, 45.0, 120.0}) {
    const Eigen::Quaterniond turned = turn(degrees, {1, -2, 0.5});
    const Eigen::Matrix3d sum = turned.toRotationMatrix() * spread;
    const Eigen::Quaterniond none = Eigen::Quaterniond::Identity();
    EXPECT_LT(distance(fitted(sum, none), best_rotation(sum, none)), 2e-6) << degrees;
    EXPECT_LT(distance(fitted(sum, turned), turned), 2e-6) << degrees;
  }
}

TEST(LocalStep, turning_everything_turns_the_rotation_with_it) {
  const Eigen::Matrix3d sum =
      turn(50, {2, 1, 0}).toRotationMatrix() * Eigen::Vector3d(1.0, 0.4, 0.3).asDiagonal();
  const Eigen::Quaterniond guess = turn(20, {0, 0, 1}), whole = turn(140, {1, 1, 1});
  const Eigen::Quaterniond before = fitted(sum, guess).cast<double>();
  EXPECT_LT(distance(fitted(whole.toRotationMatrix() * sum, whole * guess), whole * before), 2e-6);
}

TEST(LocalStep, a_neighborhood_turned_inside_out_still_gives_the_best_rotation) {
  const Eigen::Matrix3d sum = Eigen::Vector3d(1.0, 1.0, -0.3).asDiagonal();
  for (const Eigen::Quaterniond& guess : {Eigen::Quaterniond::Identity(), turn(40, {1, 2, 3})})
    EXPECT_LT(distance(fitted(sum, guess), best_rotation(sum, guess)), 1e-5);
}

TEST(LocalStep, what_the_edges_leave_open_stays_with_the_guess) {
  const Eigen::Quaterniond start = turn(30, {0, 1, 0});
  EXPECT_LT(distance(fitted(Eigen::Matrix3d::Zero(), start), start), 1e-6);
  // One edge along y says nothing about the turn round y.
  const Eigen::Matrix3d along_y = Eigen::Vector3d(0, 1, 0).asDiagonal();
  EXPECT_LT(distance(fitted(along_y, start), start), 1e-5);
}

TEST(LocalStep, a_crushed_neighborhood_does_not_flip_between_two_rotations) {
  // Turned inside out along one of two axes that are alike: without a guess that counts, which one is the
  // longer decides between rotations half a turn apart.
  const Eigen::Quaterniond guess = turn(10, {1, 0, 0});
  const auto crushed = [](double difference) -> Eigen::Matrix3d {
    return Eigen::Vector3d(1.0, 0.05 + difference, -0.05 + difference).asDiagonal();
  };
  const Eigen::Quaternionf one = fitted(crushed(1e-3), guess), other = fitted(crushed(-1e-3), guess);
  EXPECT_LT(one.angularDistance(other), 0.02f);
}

TEST(LocalStep, volume_is_won_back_by_the_power_asked_for) {
  for (const double ratio : {0.3, 0.7, 1.0, 1.4, 5.0}) {
    FitBatch batch{};
    alignas(64) float determinants[kFitLanes];
    alignas(64) float scales[kFitLanes];
    for (int lane = 0; lane < kFitLanes; ++lane) {
      for (const int diagonal : {0, 4, 8}) batch.sum[diagonal][lane] = static_cast<float>(std::cbrt(ratio));
      determinants[lane] = 1.0f;
      scales[lane] = 1.0f;
    }
    determinants[3] = 0.0f;  // flat: no volume to speak of
    correct_volume(batch, determinants, 0.7f, scales);
    EXPECT_NEAR(scales[0], std::clamp(std::pow(ratio, -0.7 / 3.0), 1 / 1.3, 1.3), 1e-5);
    EXPECT_EQ(scales[3], 1.0f);
  }
}

TEST(Quality, the_rest_shape_is_perfect_and_a_squeezed_one_is_not) {
  ThreadTeam team(1);
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), arm_options(Deform::paper), team);
  const QualityMeter meter(rig);
  Field3 positions = rig.volume.rest_positions;
  EXPECT_NEAR(meter.volume_ratio(positions), 1.0, 1e-12);
  EXPECT_NEAR(meter.local_volume_ratio(1, positions), 1.0, 1e-12);
  EXPECT_NEAR(meter.bone_drift(rest_pose(rig.skeleton), positions), 0.0, 1e-9);
  EXPECT_EQ(meter.folded_edges(positions), 0);
  EXPECT_EQ(meter.self_intersections(positions), 0);
  EXPECT_NEAR(meter.edge_stretch(positions).largest, 1.0, 1e-12);
  positions.col(1) *= 0.5;
  EXPECT_NEAR(meter.volume_ratio(positions), 0.5, 1e-9);
  EXPECT_NEAR(meter.local_volume_ratio(1, positions), 0.5, 1e-9);
  EXPECT_NEAR(meter.edge_stretch(positions).least, 0.5, 0.05);
}

TEST(Quality, a_limb_pushed_through_itself_is_counted) {
  ThreadTeam team(1);
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), arm_options(Deform::paper), team);
  const QualityMeter meter(rig);
  Field3 positions = rig.volume.rest_positions;
  linear_blend_skinning(rig, bent_arm(175), positions);
  EXPECT_GT(meter.self_intersections(positions), 0);
}

}  // namespace
}  // namespace sinew
