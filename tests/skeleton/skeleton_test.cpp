#include "skeleton/skeleton.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/skeleton/chains.h"

namespace sinew {
namespace {

std::string refusal_of(const Skeleton& skeleton) {
  try {
    check_skeleton(skeleton, "test");
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(CheckSkeleton, accepts_parents_before_children_and_several_roots) {
  Skeleton skeleton = chains::figure();
  EXPECT_EQ(refusal_of(skeleton), "accepted");
  skeleton.parents[3] = -1;
  EXPECT_EQ(refusal_of(skeleton), "accepted");
  EXPECT_EQ(refusal_of({}), "accepted");
}

TEST(CheckSkeleton, names_the_joint_whose_parent_comes_after_it) {
  Skeleton skeleton = chains::figure();
  skeleton.parents[1] = 2;
  EXPECT_EQ(refusal_of(skeleton), "test: joint 1 'arm' has parent 2; expected -1 or a joint before it");
  skeleton.parents[1] = 1;
  EXPECT_EQ(refusal_of(skeleton), "test: joint 1 'arm' has parent 1; expected -1 or a joint before it");
  skeleton.parents[1] = -2;
  EXPECT_EQ(refusal_of(skeleton), "test: joint 1 'arm' has parent -2; expected -1 or a joint before it");
}

TEST(CheckSkeleton, counts_what_is_of_another_length) {
  Skeleton skeleton = chains::figure();
  skeleton.tips.pop_back();
  EXPECT_EQ(refusal_of(skeleton),
            "test: the skeleton has 4 names, 4 parents, 4 rest transforms and 3 lists of tips; "
            "expected as many of each");
}

}  // namespace
}  // namespace sinew
