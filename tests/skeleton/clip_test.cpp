#include "skeleton/clip.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "tests/skeleton/chains.h"

namespace sinew {
namespace {

using chains::turn_about_z;

/// The figure waving: everything turns and the root walks and grows, evenly.
Clip waving(int frames, double frames_per_second) {
  Clip clip{.name = "waving", .skeleton = chains::figure(), .frames_per_second = frames_per_second,
            .frame_count = frames, .local = {}, .warnings = {"W_ONE: said once"}};
  for (int frame = 0; frame < frames; ++frame) {
    std::vector<Transform> local = clip.skeleton.rest;
    local[0].translation = {1.0 * frame, 2.0, 0.5 * frame};
    local[0].scale = Eigen::Vector3d::Constant(1.0 + 0.1 * frame);
    for (int joint = 0; joint < 4; ++joint) local[joint].rotation = turn_about_z(10.0 * frame * (joint + 1));
    clip.local.insert(clip.local.end(), local.begin(), local.end());
  }
  return clip;
}

void expect_same_transform(const Transform& a, const Transform& b, double tolerance) {
  EXPECT_LE((a.translation - b.translation).norm(), tolerance);
  EXPECT_LE((a.rotation.toRotationMatrix() - b.rotation.toRotationMatrix()).norm(), tolerance);
  EXPECT_LE((a.scale - b.scale).norm(), tolerance);
}

std::string refusal_of(const auto& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Clip, lasts_from_its_first_frame_to_its_last) {
  EXPECT_DOUBLE_EQ(waving(31, 30).duration(), 1.0);
  EXPECT_DOUBLE_EQ(waving(1, 30).duration(), 0.0);
}

TEST(PoseAt, is_forward_kinematics_of_the_frame) {
  const Clip clip = waving(5, 30);
  const Pose pose = pose_at(clip, 3);
  EXPECT_EQ(pose.positions, forward_kinematics(clip.skeleton, clip.frame(3)).positions);
}

TEST(PoseAt, refuses_frames_the_clip_does_not_have) {
  const Clip clip = waving(5, 30);
  EXPECT_EQ(refusal_of([&] { pose_at(clip, 5); }), "pose_at: frame 5 of a clip with 5 frames");
  EXPECT_EQ(refusal_of([&] { pose_at(clip, -1); }), "pose_at: frame -1 of a clip with 5 frames");
}

TEST(Resample, at_the_clips_own_rate_changes_nothing) {
  const Clip clip = waving(7, 29.97);
  const Clip same = resample(clip, 29.97 + 1e-10);
  EXPECT_EQ(same.frames_per_second, clip.frames_per_second);
  ASSERT_EQ(same.local.size(), clip.local.size());
  for (std::size_t i = 0; i < clip.local.size(); ++i) expect_same_transform(same.local[i], clip.local[i], 0.0);
}

TEST(Resample, at_a_multiple_of_the_rate_keeps_every_key_pose) {
  const Clip clip = waving(9, 24);
  for (const int times : {2, 3, 7, 1000}) {
    const Clip finer = resample(clip, 24.0 * times);
    ASSERT_EQ(finer.frame_count, 8 * times + 1);
    for (int frame = 0; frame < 9; ++frame) {
      for (int joint = 0; joint < 4; ++joint) {
        expect_same_transform(finer.frame(frame * times)[joint], clip.frame(frame)[joint], 0.0);
      }
    }
  }
}

TEST(Resample, up_and_down_again_gives_the_clip_back) {
  const Clip clip = waving(100, 30);
  const Clip back = resample(resample(clip, 120), 30);
  ASSERT_EQ(back.frame_count, clip.frame_count);
  for (std::size_t i = 0; i < clip.local.size(); ++i) expect_same_transform(back.local[i], clip.local[i], 0.0);
}

TEST(Resample, an_even_motion_stays_even) {
  const Clip clip = waving(31, 30);
  const Clip other = resample(clip, 23.0);
  ASSERT_EQ(other.frame_count, 24);
  for (int frame = 0; frame < other.frame_count; ++frame) {
    const double instant = frame * 30.0 / 23.0;  // in frames of the clip, whose motion is linear in them
    EXPECT_NEAR(other.frame(frame)[0].translation.x(), instant, 1e-12);
    EXPECT_NEAR(other.frame(frame)[0].scale.x(), 1.0 + 0.1 * instant, 1e-12);
    EXPECT_LT(other.frame(frame)[2].rotation.angularDistance(turn_about_z(30.0 * instant)), 1e-7);
  }
}

TEST(Resample, ends_with_the_last_instant_not_after_the_clips_end) {
  EXPECT_EQ(resample(waving(11, 10), 3).frame_count, 4);      // 0, 1/3, 2/3, 1 s: the end exactly
  EXPECT_EQ(resample(waving(10, 10), 3).frame_count, 3);      // 0, 1/3, 2/3 of 0.9 s
  EXPECT_EQ(resample(waving(31, 30), 29).frame_count, 30);    // the end again, though 30 / (30 / 29) < 29 in doubles
  EXPECT_EQ(resample(waving(1, 10), 1000).frame_count, 1);
  EXPECT_EQ(resample(waving(0, 10), 1000).frame_count, 0);
}

TEST(Resample, turns_the_shorter_way_whatever_the_signs) {
  Clip clip = waving(2, 1);
  clip.local[4].rotation.coeffs() *= -1.0;
  const Clip finer = resample(clip, 2);
  EXPECT_LT(finer.frame(1)[0].rotation.angularDistance(turn_about_z(5.0)), 1e-7);
}

TEST(Resample, keeps_name_skeleton_and_warnings) {
  const Clip other = resample(waving(3, 30), 60);
  EXPECT_EQ(other.name, "waving");
  EXPECT_EQ(other.skeleton.names, chains::figure().names);
  EXPECT_EQ(other.warnings, std::vector<std::string>{"W_ONE: said once"});
  EXPECT_EQ(other.frames_per_second, 60.0);
}

TEST(Resample, refuses_rates_that_are_none) {
  const Clip clip = waving(3, 30);
  EXPECT_EQ(refusal_of([&] { resample(clip, 0.0); }),
            "resample: 0.000000 frames per second; expected a positive number");
  EXPECT_EQ(refusal_of([&] { resample(clip, std::nan("")); }),
            "resample: nan frames per second; expected a positive number");
  EXPECT_EQ(refusal_of([&] { resample(clip, 1e12); }),
            "resample: 1000000000000.000000 frames per second make more frames than can be counted");
}

}  // namespace
}  // namespace sinew
