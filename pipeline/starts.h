#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "pipeline/frame_solver.h"
#include "pipeline/projection.h"
#include "pipeline/skinning_base.h"

/// Internal to pipeline/: where the solves of a frame begin.
namespace sinew {

int solve_count(const FrameOptions& options);

/// Error that a frame's solve, numbered from 0, may leave, for one of 1 in the frame's answer. Fits of
/// rotations pass on less than half of it each: measured over clips of fast motion, from an estimate before
/// the last fit at most .41 arrived, and no more than that from before the last two.
double error_allowed(const FrameOptions& options, int solve);

/// The starts of a frame's solves, foretold in time.
///
/// The first solve starts from a mixture of the last three answers: extrapolated by a polynomial of degree 0
/// to 2, or with the weights that mix this pose's foreseen positions from those of the last poses best.
/// Foreseen are positions by linear blend skinning or, better and dearer, by the rig's subspace. A foreseeing
/// start adds, at every node, what the mixture leaves of the foreseen positions; it is as good far away, so
/// that a V-cycle is enough where the others want one of full multigrid. Start::automatic tries all of them
/// on some hundred nodes in every frame and takes the one that is foretold to need the least work: an error
/// is what the mixture left of the answer less the foreseen positions one frame ago and, without foreseeing,
/// what it leaves of the foreseen positions now, which is known. Each later solve of a frame starts from the
/// answer of the one before plus the step between these two solves, mixed with the weights that would have
/// done best one frame ago.
class Starts {
 public:
  Starts(const Rig& rig, const FrameNodes& nodes, const SlotBlends& blends, const PoseRotations& rotations,
         const FrameOptions& options, ThreadTeam& team);

  void forget();

  /// Before the first solve of a frame; `rotations` has read the pose.
  void begin_frame(const Pose& pose, const PoseRotations& rotations);
  /// Before each later solve, numbered from 1.
  void choose(int solve);

  /// Finds the starts of slots [first, end) in a frame's first solve; `first` is a multiple of
  /// Subspace::kBlock. Calls for different slots may run side by side.
  void begin_first(int first, int end);
  /// The start so found.
  const Eigen::Vector4f& first_start(int slot) const { return now()[slot]; }

  /// Start of a slot in a later solve, `before` its answer of the solve before. Calls for different slots may
  /// run side by side.
  Eigen::Vector4f begin(int slot, const Eigen::Vector4f& before) { return now()[slot] = mixed(slot, before); }

  /// Once the residual of the start is known: a better start, and its residual.
  void improve(std::span<Eigen::Vector4f> residual);

  /// How far the first correction must reach.
  Reach reach() const { return choice_.reach; }

  /// The first correction of a solve. Gives the answer, which is remembered.
  Eigen::Vector4f finish(int slot, const Eigen::Vector4f& before, const Eigen::Vector4f& step) {
    const Eigen::Vector4f answer = now()[slot] + step;
    now()[slot] = answer - base(before);
    return answer;
  }
  /// A correction from where that ended moved the answer.
  void move(int slot, const Eigen::Vector4f& step) { now()[slot] += step; }

  /// After each solve: how wrong every mixture would have been on the sampled nodes.
  void judge();
  /// After the last solve of a frame.
  void end_frame() {
    ++frame_;
    known_ = std::min(known_ + 1, kFrames);
  }

  std::size_t bytes() const;

 private:
  static constexpr int kFrames = 3;
  /// Polynomials of degree 0 to 2, and the fitted weights.
  static constexpr int kMixtures = 4;
  static constexpr int kFitted = 3;

  /// Weights of the last frames in the next one, newest first.
  struct Mixture {
    int count = 0;  ///< 0: nothing of earlier frames
    std::array<float, kFrames> weights{};
  };
  struct Choice {
    Mixture mixture;
    bool foreseeing = false;
    Reach reach = Reach::far;
  };
  using SampleRing = std::array<SlotRows, kFrames + 1>;  ///< by sampled node, this frame's at frame_ % 4
  /// Of one solve: the answers less the solve before, by slot and by sampled node, and what was learnt.
  struct History {
    std::array<SlotRows, kFrames> rows;
    SampleRing sampled;
    int best = 2;                          ///< mixture
    std::array<float, kMixtures> wrong{};  ///< what each would have left, at most, of the last frame's answer
  };

  Eigen::Vector4f base(const Eigen::Vector4f& before) const {
    return solve_ > 0 ? before : Eigen::Vector4f(Eigen::Vector4f::Zero());
  }
  /// Three frames take turns: the start, then the answer, of this one takes the place of the oldest, which no
  /// other slot's start needs.
  const SlotRows& recent(int age) const { return histories_[solve_].rows[(frame_ + 2 - age) % kFrames]; }
  SlotRows& now() { return histories_[solve_].rows[frame_ % kFrames]; }
  const SlotRows& now() const { return histories_[solve_].rows[frame_ % kFrames]; }
  /// The chosen mixture of a slot's earlier answers, on top of `sum`.
  Eigen::Vector4f mixed(int slot, Eigen::Vector4f sum) const {
    for (int age = 0; age < choice_.mixture.count; ++age)
      sum += choice_.mixture.weights[age] * recent(age)[slot];
    return sum;
  }
  /// The place in a ring of four of the frame `age` frames before the last.
  int ring_place(int age) const { return (frame_ + kFrames - age) % (kFrames + 1); }

  Eigen::Vector4f left_by(const Mixture& mixture, const SampleRing& ring, std::size_t sample) const;
  Mixture fitted_mixture() const;
  Choice choose_first() const;
  Choice cheapest(bool only_foreseeing) const;
  void foresee_samples(const Pose& pose, const PoseRotations& rotations);

  const FrameNodes& nodes_;
  const SlotBlends& blends_;
  const FrameOptions options_;
  SkinningBase skinning_;
  const Subspace* subspace_;  // null: skinning foresees
  std::optional<Projection> projection_;
  std::vector<int> sampled_slots_;
  SlotBlends sampled_blends_;
  SlotRows sampled_rest_;
  std::optional<Subspace> sampled_subspace_;
  std::vector<History> histories_;                        // per solve of a frame
  std::array<Eigen::VectorXf, kFrames + 1> coordinates_;  // of the poses, this frame's at frame_ % 4
  Eigen::VectorXf unforeseen_;                            // what the chosen mixture leaves of them
  SampleRing foreseen_;
  std::array<Mixture, kMixtures> mixtures_;  // those of too many frames are empty
  /// Per mixture and sampled node: what it left of the answer less the foreseen position, squared, one frame
  /// ago.
  std::array<std::vector<float>, kMixtures> rest_errors_;
  int known_ = 0;  // frames in the histories
  int frame_ = 0;
  int solve_ = 0;
  Choice choice_;
};

}  // namespace sinew
