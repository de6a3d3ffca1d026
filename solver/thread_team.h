#pragma once

#include <cstdint>
#include <memory>

namespace sinew {

/// A fixed team of threads for loops over blocks of work that is fixed by the data.
///
/// Which thread runs a block never changes what the block computes, so results are the same bytes
/// for any team size. Running a loop allocates nothing and costs a few microseconds: threads spin
/// briefly before they sleep. One caller at a time, and a body must not start a loop on the team that
/// runs it; a team of one thread keeps no state, so any number of callers may share it.
class ThreadTeam {
 public:
  /// `thread_count` includes the calling thread; 0 or less means one per hardware thread.
  explicit ThreadTeam(int thread_count = 1);
  ~ThreadTeam();
  ThreadTeam(const ThreadTeam&) = delete;
  ThreadTeam& operator=(const ThreadTeam&) = delete;

  int thread_count() const;

  /// Calls body(block) for every block in [0, block_count), once each, and returns when all are
  /// done. An exception thrown by a body is rethrown here (the first one by block number, after all
  /// other blocks; a team of one stops at it).
  template <typename Body>
  void for_each_block(int block_count, const Body& body) {
    run(block_count, &body,
        [](const void* context, int block) { (*static_cast<const Body*>(context))(block); });
  }

 private:
  void run(int block_count, const void* context, void (*call)(const void*, int));
  struct Members;
  std::unique_ptr<Members> members_;
};

}  // namespace sinew
