#include "pipeline/starts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace sinew {
namespace {

/// One node in this many is sampled, or fewer where that would be more than a few hundred: the samples
/// cost less than a hundredth of a frame, and a hand still gets a dozen of them.
constexpr int kSampleStride = 61;
constexpr int kMostSamples = 500;

/// What the first cycle leaves of a start's error as far as samples show it, and what each later cycle
/// leaves.
constexpr double kLeftByFar = 0.008;
constexpr double kLeftByNear = 0.5;
constexpr double kLeftLater = 0.2;

/// Share of a cycle by which a start should do better than its estimate asks: estimates are off by as much.
constexpr double kSpare = 0.3;

/// A later solve's start that was wrong by less than this many tolerances a frame ago is put right by a light
/// cycle: samples miss a third of the largest error, and half of it may be left.
constexpr double kLightBelow = 1.3;

/// Costs, in cycles of full multigrid.
constexpr double kNearCost = 0.9;
constexpr double kSkinningCost = 0.25;
constexpr double kSubspaceCost = 0.13;

/// A polynomial of a degree that could not be tried yet is taken to be this much better than the next lower
/// one, squared: motion is smooth more often than not.
constexpr float kNextDegreeLeaves = 0.25f;

/// Polynomials of degree 0, 1 and 2.
constexpr std::array<std::array<float, 3>, 3> kPolynomials = {{{1, 0, 0}, {2, -1, 0}, {3, -3, 1}}};

double later_cycles(double error, double tolerance) {
  return std::max(0.0, std::log(error / tolerance) / -std::log(kLeftLater) + kSpare);
}

/// The subspace that a start of this kind uses, if any.
const Subspace* foreseeing_subspace(const Rig& rig, Start start) {
  const bool there = rig.subspace && rig.subspace->of() == SubspaceOf::free_nodes;
  if (start == Start::subspace && !there) {
    throw std::invalid_argument(
        "FrameSolver: the start is the subspace's; the rig has none of its free nodes");
  }
  return there && (start == Start::subspace || start == Start::automatic) ? &*rig.subspace : nullptr;
}

std::vector<int> nodes_at(const FrameNodes& nodes, const std::vector<int>& slots) {
  std::vector<int> result;
  for (const int slot : slots) result.push_back(nodes.node_of_slot[slot]);
  return result;
}

}  // namespace

int solve_count(const FrameOptions& options) {
  return options.deform == Deform::refined ? 1 + options.local_global : 1;
}

double error_allowed(const FrameOptions& options, int solve) {
  return 1 << std::min(solve_count(options) - 1 - solve, 2);
}

Starts::Starts(const Rig& rig, const FrameNodes& nodes, const SlotBlends& blends,
               const PoseRotations& rotations, const FrameOptions& options, ThreadTeam& team)
    : nodes_(nodes),
      blends_(blends),
      options_(options),
      skinning_(rig, nodes),
      subspace_(foreseeing_subspace(rig, options.start)),
      sampled_slots_([&] {
        std::vector<int> slots;
        const int stride = std::max(kSampleStride, nodes.free_count / kMostSamples);
        for (int slot = 0; slot < nodes.free_count; slot += stride) slots.push_back(slot);
        return slots;
      }()),
      sampled_blends_(rig.harmonics, nodes_at(nodes, sampled_slots_), rotations),
      histories_(solve_count(options)) {
  if (options_.start == Start::fischer) projection_.emplace(nodes, team);
  for (const int slot : sampled_slots_) sampled_rest_.push_back(nodes.records[slot].rest);
  const SlotRows zero(nodes.free_count, Eigen::Vector4f::Zero());
  const SlotRows none(sampled_slots_.size(), Eigen::Vector4f::Zero());
  for (History& history : histories_) {
    history.rows.fill(zero);
    history.sampled.fill(none);
  }
  if (subspace_ != nullptr) sampled_subspace_.emplace(*subspace_, sampled_slots_);
  unforeseen_ = Eigen::VectorXf::Zero(subspace_ != nullptr ? subspace_->coordinate_count()
                                                           : skinning_.coordinate_count());
  coordinates_.fill(unforeseen_);
  foreseen_.fill(none);
  rest_errors_.fill(std::vector<float>(sampled_slots_.size(), 0.0f));
}

void Starts::forget() {
  known_ = 0;
  if (projection_) projection_->forget();
}

/// What the mixture of the frames before leaves of this frame.
Eigen::Vector4f Starts::left_by(const Mixture& mixture, const SampleRing& ring, std::size_t sample) const {
  Eigen::Vector4f left = ring[frame_ % (kFrames + 1)][sample];
  for (int age = 0; age < mixture.count; ++age) left -= mixture.weights[age] * ring[ring_place(age)][sample];
  return left;
}

/// Least squares over the sampled nodes. The weights sum to one, so that it mixes moved bodies as well.
Starts::Mixture Starts::fitted_mixture() const {
  if (known_ < kFrames) return {};
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();
  Eigen::Vector2d along = Eigen::Vector2d::Zero();
  for (std::size_t sample = 0; sample < sampled_slots_.size(); ++sample) {
    const auto at = [&](int age) -> Eigen::Vector4d {
      return foreseen_[ring_place(age)][sample].cast<double>();
    };
    Eigen::Matrix<double, 4, 2> steps;
    steps << at(0) - at(1), at(1) - at(2);
    square += steps.transpose() * steps;
    along += steps.transpose() * (at(-1) - at(0));
  }
  // Answers are wrong by up to the tolerance: where hardly anything moved, large multiples would be of that.
  square.diagonal().array() +=
      static_cast<double>(sampled_slots_.size()) * options_.tolerance * options_.tolerance;
  const Eigen::Vector2f steps = (square.inverse() * along).cast<float>();
  return {kFrames, {1.0f + steps[0], steps[1] - steps[0], -steps[1]}};
}

/// The start that needs the least work; among equals the one with the smallest error.
Starts::Choice Starts::cheapest(bool only_foreseeing) const {
  const double tolerance = options_.tolerance * error_allowed(options_, 0);
  Choice best;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0; k < kMixtures; ++k) {
    const Mixture& mixture = mixtures_[k];
    if (mixture.count == 0) continue;
    float plain = 0.0f;
    float foreseeing = 0.0f;
    for (std::size_t sample = 0; sample < sampled_slots_.size(); ++sample) {
      const float rest = rest_errors_[k][sample];
      foreseeing = std::max(foreseeing, rest);
      plain = std::max(plain, rest + left_by(mixture, foreseen_, sample).squaredNorm());
    }
    const auto offer = [&](Choice choice, double error, double cost) {
      cost += later_cycles(error, tolerance) * kNearCost + 1e-3 * error / tolerance;
      if (!(cost < least)) return;
      best = choice;
      least = cost;
    };
    offer({mixture, true, Reach::near}, kLeftByNear * std::sqrt(static_cast<double>(foreseeing)),
          kNearCost + (subspace_ != nullptr ? kSubspaceCost : kSkinningCost));
    if (!only_foreseeing)
      offer({mixture, false, Reach::far}, kLeftByFar * std::sqrt(static_cast<double>(plain)), 1.0);
  }
  return best;
}

Starts::Choice Starts::choose_first() const {
  const auto polynomial = [&](int degree) { return Choice{mixtures_[std::clamp(known_ - 1, 0, degree)]}; };
  switch (options_.start) {
    case Start::zero:
      return {};
    case Start::previous:
    case Start::fischer:
      return polynomial(0);
    case Start::linear:
      return polynomial(1);
    case Start::quadratic:
      return polynomial(2);
    case Start::skinning:
    case Start::subspace:
      return known_ > 0 ? cheapest(true) : Choice{{}, true, Reach::far};
    case Start::automatic:
      break;
  }
  return known_ > 0 ? cheapest(false) : Choice{{}, true, Reach::far};
}

/// The coordinates of this pose, and what they foresee of the sampled nodes.
void Starts::foresee_samples(const Pose& pose, const PoseRotations& rotations) {
  Eigen::VectorXf& coordinates = coordinates_[frame_ % (kFrames + 1)];
  SlotRows& foreseen = foreseen_[frame_ % (kFrames + 1)];
  if (subspace_ != nullptr) {
    subspace_->read(pose, rotations, coordinates);
    for (int block = 0; block < sampled_subspace_->block_count(); ++block) {
      sampled_subspace_->evaluate(block, coordinates,
                                  &foreseen[static_cast<std::size_t>(block) * Subspace::kBlock]);
    }
    return;
  }
  skinning_.read(pose, rotations, coordinates);
  const int samples = static_cast<int>(sampled_slots_.size());
  for (int first = 0; first < samples; first += kFitLanes) {
    skinning_.evaluate(sampled_blends_, first / kFitLanes, std::min(kFitLanes, samples - first),
                       &sampled_rest_[first], coordinates, &foreseen[first]);
  }
}

void Starts::begin_frame(const Pose& pose, const PoseRotations& rotations) {
  solve_ = 0;
  if (projection_ && known_ > 1) projection_->add(recent(0), recent(1));
  foresee_samples(pose, rotations);
  for (int degree = 0; degree < kFrames; ++degree) {
    mixtures_[degree] = degree < known_ ? Mixture{degree + 1, kPolynomials[degree]} : Mixture{};
  }
  mixtures_[kFitted] = fitted_mixture();
  choice_ = choose_first();
  if (!choice_.foreseeing) return;
  unforeseen_ = coordinates_[frame_ % (kFrames + 1)];
  for (int age = 0; age < choice_.mixture.count; ++age) {
    unforeseen_ -= choice_.mixture.weights[age] * coordinates_[ring_place(age)];
  }
}

void Starts::begin_first(int first, int end) {
  std::array<Eigen::Vector4f, Subspace::kBlock> steps;
  steps.fill(Eigen::Vector4f::Zero());
  for (int begin = first; begin < end; begin += Subspace::kBlock) {
    const int count = std::min(Subspace::kBlock, end - begin);
    if (choice_.foreseeing && subspace_ != nullptr) {
      subspace_->evaluate(begin / Subspace::kBlock, unforeseen_, steps.data());
    } else if (choice_.foreseeing) {
      for (int row = 0; row < count; row += kFitLanes) {
        const int lanes = std::min(kFitLanes, count - row);
        std::array<Eigen::Vector4f, kFitLanes> rests;
        for (int lane = 0; lane < lanes; ++lane) rests[lane] = nodes_.records[begin + row + lane].rest;
        skinning_.evaluate(blends_, (begin + row) / kFitLanes, lanes, rests.data(), unforeseen_, &steps[row]);
      }
    }
    for (int row = 0; row < count; ++row) now()[begin + row] = mixed(begin + row, steps[row]);
  }
}

void Starts::choose(int solve) {
  solve_ = solve;
  int wanted = histories_[solve].best;
  if (options_.start == Start::previous) wanted = 0;
  if (options_.start == Start::linear) wanted = 1;
  if (options_.start == Start::quadratic) wanted = 2;
  if (mixtures_[wanted].count == 0) wanted = std::max(known_ - 1, 0);
  const bool from_before = options_.start == Start::zero || known_ == 0;
  // What the local step changes reaches far; extrapolated, little of it is left.
  const double tolerance = options_.tolerance * error_allowed(options_, solve);
  const Reach near = histories_[solve].wrong[wanted] < kLightBelow * tolerance ? Reach::light : Reach::near;
  choice_ = from_before ? Choice{{}, false, Reach::far} : Choice{mixtures_[wanted], false, near};
}

void Starts::improve(std::span<Eigen::Vector4f> residual) {
  if (projection_ && solve_ == 0) projection_->improve(now(), residual);
}

void Starts::judge() {
  History& history = histories_[solve_];
  SlotRows& answers = history.sampled[frame_ % (kFrames + 1)];
  std::array<float, kMixtures> worst{};
  for (std::size_t sample = 0; sample < sampled_slots_.size(); ++sample) {
    answers[sample] = now()[sampled_slots_[sample]];
    float squared = 0.0f;
    for (int k = 0; k < kMixtures; ++k) {
      const Mixture& mixture = mixtures_[k];
      Eigen::Vector4f wrong = left_by(mixture, history.sampled, sample);
      worst[k] = std::max(worst[k], wrong.squaredNorm());
      if (solve_ > 0) continue;
      if (mixture.count > 0) {
        wrong -= left_by(mixture, foreseen_, sample);
        squared = wrong.squaredNorm();
      } else if (k < kFitted) {
        squared *= kNextDegreeLeaves;
      }
      rest_errors_[k][sample] = squared;
    }
  }
  const auto least = std::min_element(worst.begin(), worst.end());
  history.best = known_ < kFrames ? 2 : static_cast<int>(least - worst.begin());
  for (int k = 0; k < kMixtures; ++k) {
    history.wrong[k] = known_ < kFrames ? std::numeric_limits<float>::infinity() : std::sqrt(worst[k]);
  }
}

std::size_t Starts::bytes() const {
  const std::size_t rows = histories_.front().rows.front().size();
  return kFrames * histories_.size() * rows * sizeof(Eigen::Vector4f) +
         5 * static_cast<std::size_t>(unforeseen_.size()) * sizeof(float) +
         (projection_ ? projection_->bytes() : 0);
}

}  // namespace sinew
