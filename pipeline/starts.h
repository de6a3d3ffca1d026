#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "pipeline/frame_solver.h"

/// Internal to pipeline/: where the solves of a frame begin.
namespace sinew {

/// One row per free slot: x, y, z and a zero, in the units of FrameNodes.
using SlotRows = std::vector<Eigen::Vector4f>;

/// The starts of a frame's solves, foretold in time.
///
/// The first solve starts from the answers of the frames before, extrapolated. Each later solve of a frame
/// starts from the answer of the one before plus the extrapolated step between these two solves. Extrapolated
/// is a polynomial through up to three frames, of the degree that Start names; Start::automatic takes for each
/// solve the degree that would have done best one frame ago.
class Starts {
 public:
  Starts(int free_count, int solves, Start start);

  void forget() { known_ = 0; }

  /// Before each solve of a frame, numbered from 0.
  void choose(int solve);

  /// Start of a slot in the chosen solve; `before` is its answer of the solve before.
  Eigen::Vector4f at(int slot, const Eigen::Vector4f& before) const {
    Eigen::Vector4f sum = base(before);
    for (int age = 0; age < terms_; ++age) sum += coefficients_[age] * recent(age)[slot];
    return sum;
  }

  /// Tries every degree against the answers at(slot, places) + steps of some slots. Before keep().
  template <typename Before>
  void judge(std::span<const Eigen::Vector4f> steps, const Before& before) {
    constexpr std::size_t stride = 61;
    std::array<float, 3> worst{};
    for (std::size_t slot = 0; slot < steps.size(); slot += stride) {
      const int i = static_cast<int>(slot);
      const Eigen::Vector4f changed = at(i, before(i)) + steps[slot] - base(before(i));
      for (int degree = 0; degree < 3; ++degree) {
        worst[degree] = std::max(worst[degree], (changed - polynomial(degree, i)).squaredNorm());
      }
    }
    settle(worst);
  }

  /// Takes note of a slot's first answer. Calls for different slots may run side by side.
  void keep(int slot, const Eigen::Vector4f& before, const Eigen::Vector4f& answer) {
    oldest()[slot] = answer - base(before);
  }
  /// A later cycle of the same solve moved the answer.
  void move(int slot, const Eigen::Vector4f& step) { oldest()[slot] += step; }
  /// After the last solve of a frame.
  void end_frame();

  std::size_t bytes() const;

 private:
  struct History {
    std::array<SlotRows, 3> rows;
    int best_degree = 2;
  };

  Eigen::Vector4f base(const Eigen::Vector4f& before) const {
    return solve_ > 0 ? before : Eigen::Vector4f(Eigen::Vector4f::Zero());
  }
  const SlotRows& recent(int age) const { return histories_[solve_].rows[(newest_ + 3 - age) % 3]; }
  SlotRows& oldest() { return histories_[solve_].rows[(newest_ + 1) % 3]; }
  Eigen::Vector4f polynomial(int degree, int slot) const;
  void settle(const std::array<float, 3>& worst);

  Start start_;
  std::vector<History> histories_;  // per solve of a frame
  int known_ = 0;                   // frames in the histories
  int newest_ = 0;
  int solve_ = 0;
  int terms_ = 0;
  std::array<float, 3> coefficients_{};
};

}  // namespace sinew
