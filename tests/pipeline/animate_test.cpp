#include "pipeline/animate.h"

#include <gtest/gtest.h>

#include <limits>

#include "arm_rig.h"
#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

Motion waving(int frames) {
  Motion motion;
  motion.name = "waving";
  for (int frame = 0; frame < frames; ++frame) {
    motion.poses.push_back(bent_arm(60 + 50 * std::sin(0.2 * frame), 40 * std::cos(0.3 * frame)));
  }
  make_continuous(motion.poses, arm_skeleton().parents());
  return motion;
}

std::vector<Field3> frames_of(const Rig& rig, const Motion& motion, const AnimateOptions& options,
                              ThreadTeam& team) {
  std::vector<Field3> frames;
  animate(rig, motion, options, team, [&](const FrameResult& result) {
    frames.push_back(*result.positions);
    return true;
  });
  return frames;
}

class Animate : public testing::Test {
 protected:
  ThreadTeam team_{1};
  Rig rig_ =
      build_rig(arm_mesh(), arm_skeleton(), arm_options(Deform::refined, SolverKind::multigrid), team_);
};

TEST_F(Animate, part_of_a_motion_has_the_bytes_of_the_whole) {
  const Motion motion = waving(30);
  for (const Start start : {Start::automatic, Start::quadratic, Start::skinning, Start::fischer}) {
    AnimateOptions options;
    options.chunk = 8;
    options.frame.start = start;
    const std::vector<Field3> whole = frames_of(rig_, motion, options, team_);
    ASSERT_EQ(whole.size(), 30u);
    options.first_frame = 13;
    options.last_frame = 22;  // across a chunk's end
    const std::vector<Field3> part = frames_of(rig_, motion, options, team_);
    ASSERT_EQ(part.size(), 10u);
    for (std::size_t k = 0; k < part.size(); ++k) EXPECT_TRUE(part[k] == whole[13 + k]) << k;
  }
}

TEST_F(Animate, one_and_two_threads_give_the_same_bytes) {
  const Motion motion = waving(6);
  ThreadTeam two(2);
  for (const Start start : {Start::automatic, Start::skinning, Start::fischer}) {
    AnimateOptions options;
    options.frame.start = start;
    const auto one_thread = frames_of(rig_, motion, options, team_);
    const auto two_threads = frames_of(rig_, motion, options, two);
    for (std::size_t k = 0; k < one_thread.size(); ++k) EXPECT_TRUE(one_thread[k] == two_threads[k]) << k;
  }
}

TEST_F(Animate, frames_come_in_order_until_the_sink_says_stop) {
  std::vector<int> seen;
  animate(rig_, waving(10), {.first_frame = 2}, team_, [&](const FrameResult& result) {
    seen.push_back(result.frame);
    return seen.size() < 3;
  });
  EXPECT_EQ(seen, (std::vector<int>{2, 3, 4}));
}

TEST_F(Animate, a_frame_reports_its_volume_and_its_farthest_vertex) {
  animate(rig_, waving(3), {}, team_, [&](const FrameResult& result) {
    EXPECT_NEAR(result.volume_ratio, 1.0, 0.06);
    // The arm's height is its thickness: two radii. The skin is one radius from the bone.
    EXPECT_GT(result.farthest_from_skeleton, 0.4);
    EXPECT_LT(result.farthest_from_skeleton, 1.0);
    EXPECT_TRUE(result.report.converged);
    return true;
  });
}

TEST_F(Animate, a_pose_that_is_not_finite_is_named) {
  Motion motion = waving(4);
  motion.poses[2].positions[1].y() = std::numeric_limits<double>::quiet_NaN();
  try {
    frames_of(rig_, motion, {}, team_);
    FAIL() << "not refused";
  } catch (const UnusableInput& error) {
    EXPECT_STREQ(error.what(),
                 "frame 2 of 'waving': joint 'lower_arm' has a value that is not a finite number");
  }
}

TEST_F(Animate, frames_beyond_the_motion_are_refused) {
  try {
    frames_of(rig_, waving(4), {.first_frame = 1, .last_frame = 7}, team_);
    FAIL() << "not refused";
  } catch (const std::invalid_argument& error) {
    EXPECT_STREQ(error.what(), "animate: frames 1 to 7 of a motion with 4 frames");
  }
}

}  // namespace
}  // namespace sinew
