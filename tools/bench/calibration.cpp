#include "tools/bench/calibration.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "tools/bench/statistics.h"

namespace sinew {
namespace {

constexpr int kDegree = 14;
constexpr int kBlock = 4096;

/// Nodes that all sweeps of a try together visit.
constexpr int kVisits = 2'000'000;

constexpr int kTries = 5;

/// How far the neighbors of a node of a three-dimensional lattice lie from it in memory.
std::vector<int> strides(int nodes) {
  const int row = std::max(1, static_cast<int>(std::cbrt(nodes)));
  const int plane = row * row;
  std::vector<int> result;
  for (const int stride : {1, row, row + 1, plane, plane + 1, plane + row, plane + row + 1}) {
    result.push_back(stride);
    result.push_back(-stride);
  }
  return result;
}

}  // namespace

Calibration::Calibration(int nodes, ThreadTeam& team)
    : team_(team), sweeps_(std::max(2, kVisits / std::max(1, nodes))), now_(nodes), next_(nodes) {
  const std::vector<int> away = strides(nodes);
  for (int node = 0; node < nodes; ++node) {
    for (const int stride : away) neighbors_.push_back(std::clamp(node + stride, 0, nodes - 1));
    for (float& number : now_[node].number) number = static_cast<float>(node % 7);
  }
}

void Calibration::sweep(const std::vector<Row>& from, std::vector<Row>& to) const {
  const int nodes = static_cast<int>(from.size());
  team_.for_each_block((nodes + kBlock - 1) / kBlock, [&](int block) {
    for (int node = block * kBlock; node < std::min(nodes, (block + 1) * kBlock); ++node) {
      Row sum = {};
      const int* const first = neighbors_.data() + static_cast<std::ptrdiff_t>(node) * kDegree;
      for (int k = 0; k < kDegree; ++k) {
        for (int lane = 0; lane < 4; ++lane) sum.number[lane] += from[first[k]].number[lane];
      }
      for (int lane = 0; lane < 4; ++lane) to[node].number[lane] = sum.number[lane] / kDegree;
    }
  });
}

double Calibration::seconds() {
  std::vector<double> tries(kTries);
  for (double& seconds : tries) seconds = one_try();
  return median(std::move(tries));
}

double Calibration::one_try() {
  const auto start = std::chrono::steady_clock::now();
  for (int k = 0; k < sweeps_; ++k) {
    sweep(now_, next_);
    now_.swap(next_);
  }
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace sinew
