#include "solver/thread_team.h"

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

/// Looks at a flag this often before sleeping on it: some tens of microseconds, longer than the gap
/// between two loops of one solve and short against a time slice of the operating system.
constexpr int kSpins = 2000;

void pause_briefly() {
#if defined(__x86_64__) || defined(__i386__)
  _mm_pause();
#endif
}

// A ticket holds the number of the current loop in its upper half and its next unclaimed block in
// the lower half. Claiming a block is one compare-and-swap of both, so a thread that wakes late, in
// the middle of a later loop, can never claim a block of it with the body of an earlier one.
constexpr std::uint64_t kClosed = 0xffffffffu;

std::uint64_t make_ticket(std::uint64_t loop, std::uint64_t block) {
  return (loop << 32) | block;
}
std::uint64_t block_of(std::uint64_t ticket) {
  return ticket & 0xffffffffu;
}

}  // namespace

struct ThreadTeam::Members {
  std::vector<std::thread> workers;
  std::uint64_t loop = 0;  // only the caller counts

  // The loop being run. Written by the caller while the ticket is closed.
  std::atomic<int> block_count{0};
  std::atomic<const void*> context{nullptr};
  std::atomic<void (*)(const void*, int)> call{nullptr};

  alignas(64) std::atomic<std::uint64_t> ticket{make_ticket(0, kClosed)};
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

  // Claims and runs blocks of the current loop until none is left.
  void take_part() {
    for (;;) {
      std::uint64_t seen = ticket.load(std::memory_order_acquire);
      if (block_of(seen) == kClosed) return;
      const int count = block_count.load(std::memory_order_relaxed);
      const auto body = call.load(std::memory_order_relaxed);
      const void* const body_context = context.load(std::memory_order_relaxed);
      const int block = static_cast<int>(block_of(seen));
      if (block >= count) return;
      if (!ticket.compare_exchange_weak(seen, seen + 1, std::memory_order_acq_rel)) continue;
      run_block(body, body_context, block);
      if (finished.fetch_add(1, std::memory_order_acq_rel) + 1 == static_cast<std::uint32_t>(count))
        finished.notify_one();
    }
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

  void work() {
    std::uint32_t known = 0;
    while (!stopping.load(std::memory_order_acquire)) {
      take_part();
      for (int spin = 0; spin < kSpins && started.load(std::memory_order_acquire) == known; ++spin)
        pause_briefly();
      started.wait(known, std::memory_order_acquire);
      known = started.load(std::memory_order_acquire);
    }
  }
};

ThreadTeam::ThreadTeam(int thread_count) : members_(std::make_unique<Members>()) {
  if (thread_count <= 0) thread_count = static_cast<int>(std::thread::hardware_concurrency());
  for (int worker = 1; worker < thread_count; ++worker)
    members_->workers.emplace_back([members = members_.get()] { members->work(); });
}

ThreadTeam::~ThreadTeam() {
  members_->stopping.store(true, std::memory_order_release);
  members_->started.fetch_add(1, std::memory_order_release);
  members_->started.notify_all();
  for (std::thread& worker : members_->workers) worker.join();
}

int ThreadTeam::thread_count() const {
  return static_cast<int>(members_->workers.size()) + 1;
}

void ThreadTeam::run(int block_count, const void* context, void (*call)(const void*, int)) {
  Members& m = *members_;
  if (m.workers.empty() || block_count < 2) {  // nothing shared is touched: see the class comment
    for (int block = 0; block < block_count; ++block) call(context, block);
    return;
  }
  m.block_count.store(block_count, std::memory_order_relaxed);
  m.context.store(context, std::memory_order_relaxed);
  m.call.store(call, std::memory_order_relaxed);
  m.finished.store(0, std::memory_order_relaxed);
  m.ticket.store(make_ticket(++m.loop, 0), std::memory_order_release);
  m.started.fetch_add(1, std::memory_order_release);
  m.started.notify_all();

  m.take_part();
  m.wait_for_finish(static_cast<std::uint32_t>(block_count));
  m.ticket.store(make_ticket(m.loop, kClosed), std::memory_order_release);
  if (m.error) std::rethrow_exception(std::exchange(m.error, nullptr));
}

}  // namespace sinew
