#include "solver/thread_team.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <numeric>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "allocation_counter.h"

namespace sinew {
namespace {

TEST(ThreadTeam, runs_every_block_once_for_any_size) {
  for (int threads : {1, 2, 3, 5}) {
    ThreadTeam team(threads);
    EXPECT_EQ(team.thread_count(), threads);
    for (int blocks : {0, 1, 2, 7, 100}) {
      std::vector<int> runs(static_cast<std::size_t>(blocks), 0);
      for (int repeat = 0; repeat < 50; ++repeat)
        team.for_each_block(blocks, [&](int block) { ++runs[block]; });
      EXPECT_EQ(runs, std::vector<int>(static_cast<std::size_t>(blocks), 50));
    }
  }
}

TEST(ThreadTeam, has_at_least_one_thread_when_asked_for_all) {
  EXPECT_GE(ThreadTeam(0).thread_count(), 1);
}

TEST(ThreadTeam, a_loop_sees_what_the_loop_before_it_wrote) {
  ThreadTeam team(3);
  std::vector<long> values(64, 1);
  for (int round = 0; round < 2000; ++round) {
    std::vector<long> next(values.size());
    team.for_each_block(16, [&](int block) {
      for (int k = 4 * block; k < 4 * block + 4; ++k) next[k] = values[63 - k] + 1;
    });
    values = next;
  }
  EXPECT_EQ(values, std::vector<long>(64, 2001));
}

TEST(ThreadTeam, wakes_up_after_a_pause) {
  ThreadTeam team(2);
  std::atomic<int> runs{0};
  for (int round = 0; round < 3; ++round) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    team.for_each_block(8, [&](int) { ++runs; });
  }
  EXPECT_EQ(runs, 24);
}

TEST(ThreadTeam, rethrows_the_first_error_by_block_number_and_stays_usable) {
  for (int threads : {1, 3}) {
    ThreadTeam team(threads);
    std::string said;
    try {
      team.for_each_block(20, [](int block) {
        if (block >= 5) throw std::runtime_error("block " + std::to_string(block));
      });
    } catch (const std::runtime_error& error) {
      said = error.what();
    }
    EXPECT_EQ(said, "block 5");
    int sum = 0;
    team.for_each_block(1, [&](int) { ++sum; });
    EXPECT_EQ(sum, 1);
  }
}

TEST(ThreadTeam, a_loop_allocates_nothing) {
  ThreadTeam team(3);
  std::vector<int> runs(40, 0);
  const auto loop = [&] { team.for_each_block(40, [&](int block) { ++runs[block]; }); };
  loop();
  const long before = allocation_count();
  for (int repeat = 0; repeat < 200; ++repeat) loop();
  EXPECT_EQ(allocation_count(), before);
}

TEST(ThreadTeam, one_thread_may_be_shared_by_callers) {
  ThreadTeam team(1);
  std::vector<long> sums(4, 0);
  std::vector<std::thread> callers;
  for (long& sum : sums)
    callers.emplace_back([&team, &sum] {
      for (int repeat = 0; repeat < 500; ++repeat) team.for_each_block(10, [&](int block) { sum += block; });
    });
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(sums, std::vector<long>(4, 500 * 45));
}

}  // namespace
}  // namespace sinew
