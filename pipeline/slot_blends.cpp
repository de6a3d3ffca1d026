#include "pipeline/slot_blends.h"

#include <algorithm>
#include <array>

namespace sinew {
namespace {

/// 1 + square / divisors[0] (1 + square / divisors[1] (1 + ...)).
template <std::size_t kCount>
SlotBlends::Lanes series(const SlotBlends::Lanes& square, const std::array<float, kCount>& divisors) {
  SlotBlends::Lanes sum = SlotBlends::Lanes{} + 1.0f;
  for (std::size_t k = kCount; k-- > 0;) sum = 1.0f + square * ((1.0f / divisors[k]) * sum);
  return sum;
}

/// Sine and cosine of angles within pi: Taylor's series of half the angle, to terms below 5e-7.
void sine_and_cosine(const SlotBlends::Lanes& angle, SlotBlends::Lanes& sine, SlotBlends::Lanes& cosine) {
  using Lanes = SlotBlends::Lanes;
  constexpr std::array<float, 5> of_sine = {-6, -20, -42, -72, -110}, of_cosine = {-2, -12, -30, -56, -90};
  const Lanes half = 0.5f * angle, square = half * half;
  const Lanes half_sine = half * series(square, of_sine), half_cosine = series(square, of_cosine);
  sine = 2.0f * half_sine * half_cosine;
  cosine = 1.0f - 2.0f * half_sine * half_sine;
}

}  // namespace

SlotBlends::SlotBlends(const HarmonicFields& fields, std::span<const int> nodes,
                       const PoseRotations& rotations) {
  for (std::size_t first = 0; first < nodes.size(); first += kFitLanes)
    append_batch(fields, nodes.subspan(first, std::min<std::size_t>(kFitLanes, nodes.size() - first)),
                 rotations);
  for (Entries* entries : {&undivided_, &twisting_}) {
    entries->turns.shrink_to_fit();
    entries->rows.shrink_to_fit();
  }
}

void SlotBlends::append_batch(const HarmonicFields& fields, std::span<const int> nodes,
                              const PoseRotations& rotations) {
  std::vector<BlendTerm> terms;
  for (std::size_t lane = 0; lane < nodes.size(); ++lane) {
    const int begin = fields.offsets[nodes[lane]];
    terms.clear();
    rotations.append_terms(&fields.fields[begin], &fields.weights[begin],
                           fields.offsets[nodes[lane] + 1] - begin, terms);
    for (const BlendTerm& term : terms) {
      const bool twists = rotations.turns()[term.turn].twists;
      Entries& entries = twists ? twisting_ : undivided_;
      const int rows = twists ? 2 : 1;
      const auto begin_of_batch = entries.turns.begin() + entries.offsets.back();
      const auto place = std::find(begin_of_batch, entries.turns.end(), term.turn) - entries.turns.begin();
      if (place == static_cast<std::ptrdiff_t>(entries.turns.size())) {
        entries.turns.push_back(term.turn);
        entries.rows.resize(entries.rows.size() + static_cast<std::size_t>(rows) * kFitLanes, 0.0f);
      }
      float* const row = &entries.rows[static_cast<std::size_t>(place) * rows * kFitLanes];
      row[lane] = term.weight;
      if (twists) row[kFitLanes + lane] = term.along;
    }
  }
  for (Entries* entries : {&undivided_, &twisting_})
    entries->offsets.push_back(static_cast<int>(entries->turns.size()));
}

Eigen::Vector4f SlotBlends::strongest(int batch, int lane, const PoseRotations& rotations) const {
  Eigen::Vector4f quaternion = {0.0f, 0.0f, 0.0f, 1.0f};
  float most = 0.0f;
  const auto offer = [&](int turn, float weight, float along) {
    if (!(weight > most)) return;
    most = weight;
    quaternion = rotations.turns()[turn].at(along);
  };
  for_each_turn(
      batch, [&](int turn, const Lanes& weights) { offer(turn, weights[lane], 0.0f); },
      [&](int turn, const Lanes& weights, const Lanes& along) { offer(turn, weights[lane], along[lane]); });
  return quaternion;
}

void SlotBlends::blend(int batch, const PoseRotations& rotations, float (&quaternions)[4][kFitLanes]) const {
  const BoneTurn* const turns = rotations.turns().data();
  Lanes sum[4] = {};
  for_each_turn(
      batch,
      [&](int turn, const Lanes& weights) {
        const float* const middle = turns[turn].middle.data();
        for (int k = 0; k < 4; ++k) sum[k] += middle[k] * weights;
      },
      [&](int turn, const Lanes& weights, const Lanes& along) {
        const float *const middle = turns[turn].middle.data(), *const across = turns[turn].across.data();
        Lanes sine, cosine;
        sine_and_cosine(turns[turn].half_twist * (along - 0.5f), sine, cosine);
        sine *= weights;
        cosine *= weights;
        for (int k = 0; k < 4; ++k) sum[k] += middle[k] * cosine + across[k] * sine;
      });
  const Lanes square = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2] + sum[3] * sum[3];
  for (int k = 0; k < 4; ++k) store(sum[k], quaternions[k]);
  for (int lane = 0; lane < kFitLanes; ++lane) {
    if (square[lane] >= PoseRotations::kLeastLength * PoseRotations::kLeastLength) continue;
    const Eigen::Vector4f alone = strongest(batch, lane, rotations);
    for (int k = 0; k < 4; ++k) quaternions[k][lane] = alone[k];
  }
}

std::size_t SlotBlends::bytes() const {
  std::size_t bytes = 0;
  for (const Entries* entries : {&undivided_, &twisting_})
    bytes += (entries->offsets.size() + entries->turns.size()) * sizeof(int) +
             entries->rows.size() * sizeof(float);
  return bytes;
}

}  // namespace sinew
