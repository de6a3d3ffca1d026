#include "pipeline/skinning.h"

#include <gtest/gtest.h>

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
  const Field3 wanted = (rig_.volume.rest_positions * whole.toRotationMatrix().transpose()).rowwise() + shift.transpose();
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
Eigen::Quaternionf fitted(const Eigen::Matrix3d& sum, const Eigen::Quaterniond& start, int lane = 5) {
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

TEST(LocalStep, the_rotation_of_rotated_edges_is_found_again) {
  const Eigen::Matrix3d spread = 1e-6 * Eigen::Vector3d(1.0, 0.5, 0.2).asDiagonal();
  for (const double degrees : {1.0, 45.0, 120.0}) {
    const Eigen::Quaterniond wanted = turn(degrees, {1, -2, 0.5});
    const Eigen::Quaternionf found = fitted(wanted.toRotationMatrix() * spread, Eigen::Quaterniond::Identity());
    EXPECT_LT(found.cast<double>().angularDistance(wanted), 2e-6) << degrees;
  }
}

TEST(LocalStep, a_neighborhood_turned_inside_out_still_gives_the_best_rotation) {
  const Eigen::Matrix3d sum = Eigen::Vector3d(1.0, 1.0, -0.3).asDiagonal();
  const Eigen::Quaternionf found = fitted(sum, Eigen::Quaterniond::Identity());
  EXPECT_NEAR((found.cast<double>().toRotationMatrix().transpose() * sum).trace(), 1.7, 1e-5);
}

TEST(LocalStep, what_the_edges_leave_open_stays_with_the_guess) {
  const Eigen::Quaterniond start = turn(30, {0, 1, 0});
  EXPECT_LT(fitted(Eigen::Matrix3d::Zero(), start).cast<double>().angularDistance(start), 1e-6);
  // One edge along y says nothing about the turn round y.
  const Eigen::Matrix3d along_y = Eigen::Vector3d(0, 1, 0).asDiagonal();
  EXPECT_LT(fitted(along_y, start).cast<double>().angularDistance(start), 1e-5);
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
