#include "pipeline/starts.h"

#include <algorithm>

namespace sinew {
namespace {

/// Weights of the last frames in the next one, newest first, for polynomials of degree 0, 1 and 2.
constexpr float kPolynomials[3][3] = {{1, 0, 0}, {2, -1, 0}, {3, -3, 1}};

int wanted_degree(Start start, int best) {
  switch (start) {
    case Start::zero:
      return -1;
    case Start::previous:
      return 0;
    case Start::linear:
      return 1;
    case Start::quadratic:
      return 2;
    case Start::automatic:
      break;
  }
  return best;
}

}  // namespace

Starts::Starts(int free_count, int solves, Start start) : start_(start), histories_(solves) {
  const SlotRows zero(free_count, Eigen::Vector4f::Zero());
  for (History& history : histories_) history.rows.fill(zero);
}

void Starts::choose(int solve) {
  solve_ = solve;
  const int degree = std::min(wanted_degree(start_, histories_[solve].best_degree), known_ - 1);
  terms_ = degree + 1;
  if (terms_ > 0) std::copy_n(kPolynomials[degree], 3, coefficients_.begin());
}

Eigen::Vector4f Starts::polynomial(int degree, int slot) const {
  Eigen::Vector4f sum = Eigen::Vector4f::Zero();
  for (int age = 0; age <= degree; ++age) sum += kPolynomials[degree][age] * recent(age)[slot];
  return sum;
}

void Starts::settle(const std::array<float, 3>& worst) {
  const int degrees = std::min(known_, 3);
  // Until all degrees could be tried the highest is taken: motion is smooth more often than not.
  histories_[solve_].best_degree =
      degrees < 3 ? 2 : static_cast<int>(std::min_element(worst.begin(), worst.end()) - worst.begin());
}

void Starts::end_frame() {
  newest_ = (newest_ + 1) % 3;
  known_ = std::min(known_ + 1, 3);
}

std::size_t Starts::bytes() const {
  const std::size_t rows = histories_.empty() ? 0 : histories_.front().rows.front().size();
  return 3 * histories_.size() * rows * sizeof(Eigen::Vector4f);
}

}  // namespace sinew
