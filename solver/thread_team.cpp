#include "solver/thread_team.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#if defined(__x86_64__) || defined(__i386__)
#include <immintrin.h>
#endif

namespace sinew {
namespace {

/// Looks at a flag this often before sleeping on it: some hundreds of microseconds, longer than the serial
/// steps between two loops of one solve. Waking a thread that sleeps can take as long as a sweep.
constexpr int kSpins = 10000;

void pause_briefly() {
#if defined(__x86_64__) || defined(__i386__)
  _mm_pause();
#endif
}

/// The blocks of a loop are dealt out in equal shares, one a thread, each a run of neighboring blocks. A
/// thread works through its own share and then helps with the others': so long as all are awake, what a
/// thread wrote in one loop it finds in its own cache in the next.
///
/// The ticket of a share holds the number of the loop, the share's next unclaimed block and its end. Claiming
/// a block is one compare-and-swap of all three, so a thread that wakes late, in the middle of a later loop,
/// can never claim a block of it with the body of an earlier one, nor one past an earlier end.
struct alignas(64) Share {
  std::atomic<std::uint64_t> ticket{0};
};

constexpr int kBlockBits = 20;
constexpr std::uint64_t kBlockMask = (std::uint64_t{1} << kBlockBits) - 1;

/// Loops over more blocks are run in rounds.
constexpr int kMostBlocks = static_cast<int>(kBlockMask);

std::uint64_t make_ticket(std::uint64_t loop, int block, int end) {
  return (loop << (2 * kBlockBits)) | (static_cast<std::uint64_t>(block) << kBlockBits) |
         static_cast<std::uint64_t>(end);
}
int block_of(std::uint64_t ticket) {
  return static_cast<int>((ticket >> kBlockBits) & kBlockMask);
}
int end_of(std::uint64_t ticket) {
  return static_cast<int>(ticket & kBlockMask);
}
constexpr std::uint64_t kNextBlock = std::uint64_t{1} << kBlockBits;

int share_begin(int block_count, int share, int shares) {
  return static_cast<int>(static_cast<std::int64_t>(block_count) * share / shares);
}

}  // namespace

struct ThreadTeam::Members {
  std::vector<std::thread> workers;
  std::vector<Share> shares;  // one a thread, the caller's first
  std::uint64_t loop = 0;     // only the caller counts

  // The loop being run. Written by the caller while no share has a block left.
  std::atomic<int> block_count{0};
  std::atomic<int> first_block{0};
  std::atomic<const void*> context{nullptr};
  std::atomic<void (*)(const void*, int)> call{nullptr};

  alignas(64) std::atomic<std::uint32_t> finished{0};  // blocks of the current loop
  alignas(64) std::atomic<std::uint32_t> started{0};   // loops begun; workers sleep on it
  std::atomic<bool> stopping{false};

  std::mutex error_mutex;
  std::exception_ptr error;
  int error_block = 0;

  void keep_error(int block) {
    const std::lock_guard<std::mutex> lock(error_mutex);
    if (error && error_block <= block) return;
    error = std::current_exception();
    error_block = block;
  }

  void run_block(void (*body)(const void*, int), const void* body_context, int block) {
    try {
      body(body_context, block);
    } catch (...) {
      keep_error(block);
    }
  }

  // Claims and runs blocks of one share until none is left; returns how many.
  std::uint32_t work_off(int share) {
    std::atomic<std::uint64_t>& ticket = shares[share].ticket;
    std::uint32_t done = 0;
    for (;;) {
      std::uint64_t seen = ticket.load(std::memory_order_acquire);
      if (block_of(seen) >= end_of(seen)) return done;
      const int block = first_block.load(std::memory_order_relaxed) + block_of(seen);
      const auto body = call.load(std::memory_order_relaxed);
      const void* const body_context = context.load(std::memory_order_relaxed);
      if (!ticket.compare_exchange_weak(seen, seen + kNextBlock, std::memory_order_acq_rel)) continue;
      run_block(body, body_context, block);
      ++done;
    }
  }

  // Runs blocks of the current loop until none is left, those of the own share first.
  void take_part(int own_share) {
    std::uint32_t done = 0;
    for (int k = 0; k < thread_count(); ++k) done += work_off((own_share + k) % thread_count());
    if (done == 0) return;
    const auto count = static_cast<std::uint32_t>(block_count.load(std::memory_order_relaxed));
    if (finished.fetch_add(done, std::memory_order_acq_rel) + done == count) finished.notify_one();
  }

  int thread_count() const { return static_cast<int>(shares.size()); }

  void run_round(int first, int count, const void* body_context, void (*body)(const void*, int)) {
    block_count.store(count, std::memory_order_relaxed);
    first_block.store(first, std::memory_order_relaxed);
    context.store(body_context, std::memory_order_relaxed);
    call.store(body, std::memory_order_relaxed);
    finished.store(0, std::memory_order_relaxed);
    ++loop;
    for (int share = 0; share < thread_count(); ++share)
      shares[share].ticket.store(make_ticket(loop, share_begin(count, share, thread_count()),
                                             share_begin(count, share + 1, thread_count())),
                                 std::memory_order_release);
    started.fetch_add(1, std::memory_order_release);
    started.notify_all();
    take_part(0);
    wait_for_finish(static_cast<std::uint32_t>(count));
  }

  void wait_for_finish(std::uint32_t count) {
    for (int spin = 0; spin < kSpins; ++spin) {
      if (finished.load(std::memory_order_acquire) == count) return;
      pause_briefly();
    }
    for (std::uint32_t seen = finished.load(std::memory_order_acquire); seen != count;
         seen = finished.load(std::memory_order_acquire))
      finished.wait(seen, std::memory_order_acquire);
  }

  void work(int own_share) {
    std::uint32_t known = 0;
    while (!stopping.load(std::memory_order_acquire)) {
      take_part(own_share);
      for (int spin = 0; spin < kSpins && started.load(std::memory_order_acquire) == known; ++spin)
        pause_briefly();
      started.wait(known, std::memory_order_acquire);
      known = started.load(std::memory_order_acquire);
    }
  }
};

ThreadTeam::ThreadTeam(int thread_count) : members_(std::make_unique<Members>()) {
  if (thread_count <= 0) thread_count = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  members_->shares = std::vector<Share>(thread_count);
  for (int worker = 1; worker < thread_count; ++worker)
    members_->workers.emplace_back([members = members_.get(), worker] { members->work(worker); });
}

ThreadTeam::~ThreadTeam() {
  members_->stopping.store(true, std::memory_order_release);
  members_->started.fetch_add(1, std::memory_order_release);
  members_->started.notify_all();
  for (std::thread& worker : members_->workers) worker.join();
}

int ThreadTeam::thread_count() const {
  return members_->thread_count();
}

void ThreadTeam::run(int block_count, const void* context, void (*call)(const void*, int)) {
  Members& m = *members_;
  if (m.workers.empty() || block_count < 2) {  // nothing shared is touched: see the class comment
    for (int block = 0; block < block_count; ++block) call(context, block);
    return;
  }
  for (int first = 0; first < block_count; first += kMostBlocks)
    m.run_round(first, std::min(kMostBlocks, block_count - first), context, call);
  if (m.error) std::rethrow_exception(std::exchange(m.error, nullptr));
}

}  // namespace sinew
