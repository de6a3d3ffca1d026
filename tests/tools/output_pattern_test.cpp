#include "tools/output_pattern.h"

#include <gtest/gtest.h>

namespace sinew {
namespace {

TEST(OutputPattern, puts_the_frame_number_where_the_name_says) {
  EXPECT_EQ(numbered("out/a_####.obj", 7), "out/a_0007.obj");
  EXPECT_EQ(numbered("a#.obj", 123), "a123.obj");
  EXPECT_EQ(numbered("a_{frame:04}.obj", 7), "a_0007.obj");
  EXPECT_EQ(numbered("a_{frame}.obj", 7), "a_7.obj");
  EXPECT_EQ(numbered("out/walk.obj", 7), "out/walk_0007.obj");
}

}  // namespace
}  // namespace sinew
