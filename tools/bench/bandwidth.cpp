#include "tools/bench/bandwidth.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

#include "tools/bench/statistics.h"

namespace sinew {
namespace {

constexpr std::size_t kWords = std::size_t{64} << 20;  // 512 MB of 8 bytes
constexpr int kBlocks = 256;
constexpr int kPasses = 15;

/// Sums of integers may be taken in any order, so the compiler reads as wide as it can.
std::uint64_t sum_block(const std::vector<std::uint64_t>& words, int block) {
  const std::size_t size = kWords / kBlocks;
  const std::uint64_t* const begin = words.data() + static_cast<std::size_t>(block) * size;
  return std::accumulate(begin, begin + size, std::uint64_t{0});
}

}  // namespace

double read_bandwidth(ThreadTeam& team) {
  std::vector<std::uint64_t> words(kWords, 1);
  std::vector<std::uint64_t> sums(kBlocks);
  std::vector<double> rates;
  for (int pass = 0; pass < kPasses; ++pass) {
    const auto start = std::chrono::steady_clock::now();
    team.for_each_block(kBlocks, [&](int block) { sums[block] = sum_block(words, block); });
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    // A sum that is looked at cannot be left out.
    if (std::accumulate(sums.begin(), sums.end(), std::uint64_t{0}) != kWords) return 0.0;
    rates.push_back(static_cast<double>(kWords) * sizeof(std::uint64_t) / seconds);
  }
  return median(std::move(rates));
}

}  // namespace sinew
