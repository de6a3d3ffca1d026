#include "tools/frame_range.h"

#include <gtest/gtest.h>

#include <stdexcept>

namespace sinew {
namespace {

TEST(FrameRange, reads_what_people_write) {
  struct Case {
    const char* text;
    int first, last, step;
  };
  for (const Case& expected : {Case{"12", 12, 12, 1}, Case{"1-100", 1, 100, 1}, Case{"1-100x5", 1, 100, 5},
                               Case{"-10--1", -10, -1, 1}, Case{"-1", -1, -1, 1}}) {
    const FrameRange range = parse_frame_range(expected.text);
    EXPECT_EQ(range.first, expected.first) << expected.text;
    EXPECT_EQ(range.last, expected.last) << expected.text;
    EXPECT_EQ(range.step, expected.step) << expected.text;
  }
}

TEST(FrameRange, refuses_everything_else_with_one_sentence) {
  for (const char* text : {"", "a", "0", "1-", "1-2-3", "1-5x0", "1-5x", "1,2", "99999999999"}) {
    try {
      parse_frame_range(text);
      ADD_FAILURE() << "accepted '" << text << "'";
    } catch (const std::invalid_argument& error) {
      EXPECT_EQ(error.what(), "--frames: found '" + std::string(text) +
                                  "', expected FRAME, FIRST-LAST or FIRST-LASTxSTEP (first frame 1, -1 the last)");
    }
  }
}

TEST(FrameRange, resolves_to_frames_the_clip_has) {
  const FrameRange all = resolve({1, -1, 1}, 50);
  EXPECT_EQ(all.first, 0);
  EXPECT_EQ(all.last, 49);
  const FrameRange tail = resolve({-10, 999, 2}, 50);
  EXPECT_EQ(tail.first, 40);
  EXPECT_EQ(tail.last, 49);
  EXPECT_THROW(resolve({60, 70, 1}, 50), std::invalid_argument);
}

}  // namespace
}  // namespace sinew
