// Both passes of a frame: [Shi et al. 2006, sections 2 and 7], the local/global iterations after
// [Sorkine and Alexa 2007], the accumulated volume scale an addition of this project.
#include "pipeline/frame_solver.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "pipeline/frame_nodes.h"
#include "pipeline/local_step.h"
#include "pipeline/rotation_field.h"
#include "pipeline/starts.h"
#include "solver/wide.h"

namespace sinew {
namespace {

/// Nodes per block of parallel work, a multiple of kFitLanes: some tens of microseconds each.
constexpr int kBlock = 2048;
static_assert(kBlock % kFitLanes == 0 && kBlock % Subspace::kBlock == 0);

/// Below this, rounding of positions in single precision is what is left.
constexpr double kLeastTolerance = 1e-6;

/// Up to this many tolerances, what a cycle is estimated to have left is taken away by a light one.
constexpr double kFurtherLightBelow = 2.0;

/// Of a cycle that must be the last one.
constexpr double kNoLimit = std::numeric_limits<double>::infinity();

/// A correction whose rounding takes more of the tolerance is followed by one of a new residual.
constexpr double kRoundingShare = 0.1;

using Vector4 = Wide<float, 4>;
using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

int block_count(int count) {
  return (count + kBlock - 1) / kBlock;
}

Eigen::Vector4f with_zero(const Eigen::Vector3d& vector) {
  Eigen::Vector4f four = Eigen::Vector4f::Zero();
  four.head<3>() = vector.cast<float>();
  return four;
}

/// Calls body(slot, count) for whole batches, and one by one for what is left: the count is a constant.
template <typename Body>
void for_each_batch(int first, int end, const Body& body) {
  int slot = first;
  for (; slot + kFitLanes <= end; slot += kFitLanes) body(slot, std::integral_constant<int, kFitLanes>{});
  for (; slot < end; ++slot) body(slot, std::integral_constant<int, 1>{});
}

}  // namespace

const char* stage_name(FrameStage stage) {
  constexpr std::array<const char*, kFrameStageCount> names = {"start", "rotations", "residual",
                                                               "solve", "local",     "measure"};
  return names[static_cast<int>(stage)];
}

struct FrameSolver::Members {
  Members(const Rig& rig_in, const FrameOptions& options_in, ThreadTeam& team_in);

  FrameReport solve(const Pose& pose);

  const Rig& rig;
  FrameOptions options;
  ThreadTeam& team;
  FrameNodes nodes;
  std::vector<char> given;  // per free slot: in a bone's cylinder, its rotation is the bone's

  PoseRotations pose_rotations;
  SlotBlends blends;
  Starts starts;
  // For the local steps, per slot; empty where there are none.
  LargeVector<Eigen::Quaternionf> rotations;
  LargeVector<float> pose_scales;
  LargeVector<float> volume_scales;
  std::vector<Eigen::Vector3d> held_positions;       // per constrained slot: relative to origin
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  // the pose's first joint
  std::unique_ptr<CorrectionWorkspace> workspace;
  std::vector<SystemSize> block_sizes;

 private:
  template <typename Body>
  void for_each_block(int count, const Body& body) const;
  template <typename Step>
  void timed(FrameStage stage, FrameReport& report, const Step& step) const;

  void blend(const Pose& pose);
  void pin(const Pose& pose);
  void pin_slot(int slot, const Eigen::Vector3d& position);
  Eigen::Vector3d turned(int slot, const Eigen::Vector3d& arm) const;
  Eigen::Vector3d core_place(const Pose& pose, const CoreConstraint& core) const;
  void fit_locally();
  template <int kCount>
  FitBatch batch_from(int first) const;
  template <int kCount>
  FitBatch blended_from(int first) const;
  float blended_scale(int slot) const;
  template <int kCount>
  void write_rotations(const FitBatch& batch, int first);
  template <int kCount, typename StartAt>
  void write_records(const FitBatch& batch, int first, const float (&scales)[kFitLanes],
                     const StartAt& start_at);
  template <int kCount>
  FitBatch batch_to_fit(int first, int& next_run) const;
  template <int kCount>
  void take_fit(FitBatch& batch, int first);

  void correct_until_good(FrameReport& report);
  void advance(bool first);
  void update_records();
  double measured_residual();
};

FrameSolver::Members::Members(const Rig& rig_in, const FrameOptions& options_in, ThreadTeam& team_in)
    : rig(rig_in),
      options(options_in),
      team(team_in),
      nodes(rig_in),
      pose_rotations(rig_in.skeleton, rig_in.binding),
      blends(rig_in.harmonics, {nodes.node_of_slot.data(), nodes.node_of_slot.size()}, pose_rotations),
      starts(rig_in, nodes, blends, pose_rotations, options_in, team_in) {
  if (solve_count(options) > 1) {
    rotations.assign(nodes.slot_count, Eigen::Quaternionf::Identity());
    pose_scales.assign(nodes.slot_count, 1.0f);
    volume_scales.assign(nodes.slot_count, 1.0f);
  }
  held_positions.assign(nodes.slot_count - nodes.free_count, Eigen::Vector3d::Zero());
  given.assign(nodes.free_count, 0);
  for (const FieldConstraint& constraint : rig.binding.field_constraints) {
    const int slot = nodes.slot_of_node[constraint.node];
    if (slot < nodes.free_count) given[slot] = 1;
  }
  block_sizes.resize(block_count(nodes.free_count));
  if (rig.solver) workspace = rig.solver->make_correction_workspace();
}

/// Calls body(first, end) for blocks of [0, count).
template <typename Body>
void FrameSolver::Members::for_each_block(int count, const Body& body) const {
  team.for_each_block(block_count(count),
                      [&](int block) { body(block * kBlock, std::min(count, (block + 1) * kBlock)); });
}

template <typename Step>
void FrameSolver::Members::timed(FrameStage stage, FrameReport& report, const Step& step) const {
  const Clock::time_point begin = Clock::now();
  step();
  report.milliseconds[static_cast<int>(stage)] += milliseconds_since(begin);
}

/// A batch with the rotations of slots from `first` on, its sums still open. Lanes without a slot ask
/// nothing.
template <int kCount>
FitBatch FrameSolver::Members::batch_from(int first) const {
  FitBatch batch;
  if constexpr (kCount < kFitLanes) batch = {};
  for (int lane = 0; lane < kCount; lane += 4) {
    Vector4 four[4] = {};
    for (int k = 0; k < std::min(4, kCount - lane); ++k)
      four[k] = loaded<Vector4>(rotations[first + lane + k].coeffs().data());
    transpose(four[0], four[1], four[2], four[3]);
    for (int k = 0; k < 4; ++k) store(four[k], &batch.rotation[k][lane]);
  }
  for (int lane = kCount; lane < kFitLanes; ++lane) batch.rotation[3][lane] = 1.0f;
  return batch;
}

/// And back.
template <int kCount>
void FrameSolver::Members::write_rotations(const FitBatch& batch, int first) {
  for (int lane = 0; lane < kCount; lane += 4) {
    Vector4 four[4];
    for (int k = 0; k < 4; ++k) four[k] = loaded<Vector4>(&batch.rotation[k][lane]);
    transpose(four[0], four[1], four[2], four[3]);
    for (int k = 0; k < std::min(4, kCount - lane); ++k)
      store(four[k], rotations[first + lane + k].coeffs().data());
  }
}

/// A batch with the blended rotations of slots from `first` on.
template <int kCount>
FitBatch FrameSolver::Members::blended_from(int first) const {
  FitBatch batch;
  blends.blend(first / kFitLanes, pose_rotations, batch.rotation);
  if constexpr (kCount < kFitLanes) {
    for (auto& numbers : batch.rotation) numbers[0] = numbers[first % kFitLanes];
  }
  return batch;
}

float FrameSolver::Members::blended_scale(int slot) const {
  const HarmonicFields& fields = rig.harmonics;
  const int node = nodes.node_of_slot[slot];
  const int begin = fields.offsets[node], end = fields.offsets[node + 1];
  return pose_rotations.blend_scale(&fields.fields[begin], &fields.weights[begin], end - begin);
}

/// The columns of the batch's rotations, times the scales, and the starts of the solve to come, into the
/// records.
template <int kCount, typename StartAt>
void FrameSolver::Members::write_records(const FitBatch& batch, int first, const float (&scales)[kFitLanes],
                                         const StartAt& start_at) {
  alignas(64) float matrices[9][kFitLanes];
  rotation_matrices(batch, matrices);
  for (auto& entry : matrices) {
    for (int lane = 0; lane < kFitLanes; ++lane) entry[lane] *= scales[lane];
  }
  for (int lane = 0; lane < kCount; lane += 4) {
    const int slots = std::min(4, kCount - lane);
    Vector4 start[4] = {}, rest[4] = {};
    for (int k = 0; k < slots; ++k) {
      start[k] = loaded<Vector4>(start_at(first + lane + k).data());
      rest[k] = loaded<Vector4>(nodes.records[first + lane + k].rest.data());
    }
    transpose(start[0], start[1], start[2], start[3]);
    transpose(rest[0], rest[1], rest[2], rest[3]);
    const auto entry = [&](int row, int column) {
      return loaded<Vector4>(&matrices[3 * row + column][lane]);
    };
    for (int axis = 0; axis < 3; ++axis) {
      const Vector4 turned = entry(axis, 0) * rest[0] + entry(axis, 1) * rest[1] + entry(axis, 2) * rest[2];
      Vector4 columns[4] = {entry(0, axis), entry(1, axis), entry(2, axis), 0.5f * turned - start[axis]};
      transpose(columns[0], columns[1], columns[2], columns[3]);
      for (int k = 0; k < slots; ++k) store(columns[k], nodes.records[first + lane + k].column[axis].data());
    }
  }
}

/// Rotations and scales of the pose, the start of the first solve, and no volume correction yet.
void FrameSolver::Members::blend(const Pose& pose) {
  pose_rotations.read(pose);
  starts.begin_frame(pose, pose_rotations);
  for_each_block(nodes.slot_count, [&](int first, int end) {
    const int free_end = std::min(end, nodes.free_count);
    starts.begin_first(first, free_end);
    for_each_batch(first, end, [&](int slot, auto count) {
      const FitBatch batch = blended_from<count>(slot);
      alignas(64) float scales[kFitLanes];
      std::fill_n(scales, kFitLanes, 1.0f);
      if (!pose_rotations.rigid()) {
        for (int lane = 0; lane < count; ++lane) scales[lane] = blended_scale(slot + lane);
      }
      if (!rotations.empty()) {
        write_rotations<count>(batch, slot);
        std::copy_n(scales, count(), &pose_scales[slot]);
        std::fill_n(&volume_scales[slot], count(), 1.0f);
      }
      write_records<count>(batch, slot, scales, [&](int k) {
        return k < free_end ? starts.first_start(k) : Eigen::Vector4f(Eigen::Vector4f::Zero());
      });
    });
  });
}

Eigen::Vector3d FrameSolver::Members::turned(int slot, const Eigen::Vector3d& arm) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    sum += arm[axis] * nodes.records[slot].column[axis].head<3>().cast<double>();
  }
  return sum;
}

Eigen::Vector3d FrameSolver::Members::core_place(const Pose& pose, const CoreConstraint& core) const {
  const int joint = rig.binding.bones[core.bone].joint;
  const Eigen::Vector3d& rest_joint = rig.skeleton.joints[joint].position;
  const auto carried = [&](const Eigen::Vector3d& point) -> Eigen::Vector3d {
    return pose.positions[joint] + pose.scales[joint] * (pose.rotations[joint] * (point - rest_joint));
  };
  if (core.end_joint < 0) return carried(core.foot);
  const Eigen::Vector3d& rest_end = rig.skeleton.joints[core.end_joint].position;
  return carried(core.foot) + core.along * (pose.positions[core.end_joint] - carried(rest_end));
}

void FrameSolver::Members::pin_slot(int slot, const Eigen::Vector3d& position) {
  const Eigen::Vector4f now = with_zero(position / nodes.diagonal);
  held_positions[slot - nodes.free_count] = position;
  nodes.places[slot].now = now;
  nodes.set_position(slot, now);
}

void FrameSolver::Members::pin(const Pose& pose) {
  const Binding& binding = rig.binding;
  const auto rest = [&](int node) -> Eigen::Vector3d {
    return rig.volume.rest_positions.row(node).transpose();
  };
  for_each_block(static_cast<int>(binding.spheres.size()), [&](int first, int end) {
    for (int k = first; k < end; ++k) {
      const SphereConstraint& sphere = binding.spheres[k];
      const int slot = nodes.slot_of_node[sphere.node];
      const Eigen::Vector3d arm = rest(sphere.node) - rig.skeleton.joints[sphere.joint].position;
      pin_slot(slot, pose.positions[sphere.joint] - origin + turned(slot, arm));
    }
  });
  for_each_block(static_cast<int>(binding.cores.size()), [&](int first, int end) {
    for (int k = first; k < end; ++k) {
      const CoreConstraint& core = binding.cores[k];
      const int slot = nodes.slot_of_node[core.node];
      pin_slot(slot, core_place(pose, core) - origin + turned(slot, rest(core.node) - core.foot));
    }
  });
  for_each_block(static_cast<int>(binding.glued.size()), [&](int first, int end) {
    for (int k = first; k < end; ++k) {
      const auto& [node, bone] = binding.glued[k];
      const int joint = binding.bones[bone].joint;
      const Eigen::Vector3d arm = pose.scales[joint] * (rest(node) - rig.skeleton.joints[joint].position);
      pin_slot(nodes.slot_of_node[node], pose.positions[joint] - origin + pose.rotations[joint] * arm);
    }
  });
}

/// The batch of slots from `first` on, with the sums over their edges.
template <int kCount>
FitBatch FrameSolver::Members::batch_to_fit(int first, int& next_run) const {
  FitBatch batch = batch_from<kCount>(first);
  sum_edges(nodes, first, kCount, next_run, batch);
  return batch;
}

/// What follows from its new rotations.
template <int kCount>
void FrameSolver::Members::take_fit(FitBatch& batch, int first) {
  alignas(64) float determinants[kFitLanes] = {};
  alignas(64) float scales[kFitLanes] = {};
  alignas(64) float factors[kFitLanes] = {};
  for (int lane = 0; lane < kCount; ++lane) {
    const float pose_scale = pose_scales[first + lane];
    determinants[lane] =
        nodes.inverse_rest_determinants[first + lane] / (pose_scale * pose_scale * pose_scale);
    scales[lane] = volume_scales[first + lane];
  }
  if (options.volume_gain != 0.0)
    correct_volume(batch, determinants, static_cast<float>(options.volume_gain), scales);
  for (int lane = 0; lane < kCount; ++lane) {
    volume_scales[first + lane] = scales[lane];
    factors[lane] = pose_scales[first + lane] * scales[lane];
    if (!given[first + lane]) continue;
    for (int k = 0; k < 4; ++k) batch.rotation[k][lane] = rotations[first + lane].coeffs()[k];
  }
  write_rotations<kCount>(batch, first);
  write_records<kCount>(batch, first, factors,
                        [&](int slot) { return starts.begin(slot, nodes.places[slot].now); });
}

/// New rotations and scales from the positions now, and the start of the solve to come.
void FrameSolver::Members::fit_locally() {
  for_each_block(nodes.free_count, [&](int first, int end) {
    int next_run = first_run_behind(nodes.runs, first);
    int slot = first;
    for (; slot + 2 * kFitLanes <= end; slot += 2 * kFitLanes) {
      std::array<FitBatch, 2> batches = {batch_to_fit<kFitLanes>(slot, next_run),
                                         batch_to_fit<kFitLanes>(slot + kFitLanes, next_run)};
      fit_rotations(batches);
      take_fit<kFitLanes>(batches[0], slot);
      take_fit<kFitLanes>(batches[1], slot + kFitLanes);
    }
    for_each_batch(slot, end, [&](int left, auto count) {
      FitBatch batch = batch_to_fit<count>(left, next_run);
      fit_rotations(batch);
      take_fit<count>(batch, left);
    });
  });
}

/// Adds the correction to the positions.
void FrameSolver::Members::advance(bool first) {
  const std::span<const Eigen::Vector4f> steps = workspace->correction;
  for_each_block(nodes.free_count, [&](int begin, int end) {
    for (int slot = begin; slot < end; ++slot) {
      Eigen::Vector4f& now = nodes.places[slot].now;
      if (first) {
        now = starts.finish(slot, now, steps[slot]);
      } else {
        starts.move(slot, steps[slot]);
        now += steps[slot];
      }
    }
  });
}

void FrameSolver::Members::update_records() {
  for_each_block(nodes.free_count, [&](int first, int end) {
    for (int slot = first; slot < end; ++slot) nodes.set_position(slot, nodes.places[slot].now);
  });
}

/// One solve, from the start in the records to positions in the places.
void FrameSolver::Members::correct_until_good(FrameReport& report) {
  const double allowed = error_allowed(options, report.solves++);
  if (!workspace) return;
  const double tolerance = allowed * std::max(options.tolerance, kLeastTolerance);
  CorrectionReport step;
  int cycles = 0;
  bool first = true;
  const auto count = [&] {
    cycles += std::max(step.cycles, 1);
    report.cycles += step.cycles;
    if (step.reach == Reach::far) report.full_cycles += step.cycles;
    if (step.reach == Reach::whole) ++report.whole_cycles;
    if (step.reach == Reach::light) report.light_cycles += step.cycles;
  };
  const auto wanting = [&] { return !(step.error_left <= tolerance) && cycles < options.max_cycles; };
  do {
    timed(FrameStage::residual, report, [&] {
      if (!first) update_records();
      for_each_block(nodes.free_count, [&](int begin, int end) {
        residual_rows(nodes, begin, end, workspace->residual.data());
      });
      if (first) starts.improve(workspace->residual);
    });
    timed(FrameStage::solve, report, [&] {
      const double enough = cycles + 1 < options.max_cycles ? tolerance : kNoLimit;
      step = rig.solver->correct(first ? starts.reach() : Reach::near, enough, *workspace);
      count();
      while (wanting() && step.rounding <= kRoundingShare * tolerance) {
        const Reach further = step.error_left <= kFurtherLightBelow * tolerance ? Reach::light : Reach::near;
        step = rig.solver->correct_further(further, *workspace);
        count();
      }
      advance(first);
    });
    first = false;
  } while (wanting());
  starts.judge();
  const double error = step.error_left / allowed;
  report.error = error <= report.error ? report.error : error;
  report.converged = report.converged && step.error_left <= tolerance;
}

double FrameSolver::Members::measured_residual() {
  update_records();
  for_each_block(nodes.free_count,
                 [&](int first, int end) { block_sizes[first / kBlock] = measure_rows(nodes, first, end); });
  SystemSize size;
  for (const SystemSize& block : block_sizes) {
    size.residual += block.residual;
    size.right_hand_side += block.right_hand_side;
  }
  return size.right_hand_side > 0.0 ? std::sqrt(size.residual / size.right_hand_side) : 0.0;
}

FrameReport FrameSolver::Members::solve(const Pose& pose) {
  if (pose.joint_count() != rig.skeleton.joint_count()) {
    throw std::invalid_argument("FrameSolver::solve: got " + std::to_string(pose.joint_count()) +
                                " joints; the rig has " + std::to_string(rig.skeleton.joint_count()));
  }
  FrameReport report;
  report.converged = true;
  origin = pose.positions.front();
  timed(FrameStage::rotations, report, [&] {
    blend(pose);
    pin(pose);
  });
  correct_until_good(report);
  for (int solve = 1; solve < solve_count(options); ++solve) {
    timed(FrameStage::local, report, [&] {
      starts.choose(solve);
      fit_locally();
    });
    correct_until_good(report);
  }
  starts.end_frame();
  if (options.measure_residual)
    timed(FrameStage::measure, report, [&] { report.residual = measured_residual(); });
  return report;
}

FrameSolver::FrameSolver(const Rig& rig, const FrameOptions& options, ThreadTeam& team)
    : members_(std::make_unique<Members>(rig, options, team)) {}
FrameSolver::~FrameSolver() = default;
FrameSolver::FrameSolver(FrameSolver&&) noexcept = default;

FrameReport FrameSolver::solve(const Pose& pose) {
  return members_->solve(pose);
}

void FrameSolver::forget() {
  members_->starts.forget();
}

void FrameSolver::read_positions(Eigen::Ref<Field3> positions) const {
  const Members& m = *members_;
  if (positions.rows() > m.nodes.slot_count) {
    throw std::invalid_argument("FrameSolver::read_positions: " + std::to_string(positions.rows()) +
                                " rows; the rig has " + std::to_string(m.nodes.slot_count) + " nodes");
  }
  const int rows = static_cast<int>(positions.rows());
  m.team.for_each_block(block_count(rows), [&](int block) {
    for (int node = block * kBlock; node < std::min(rows, (block + 1) * kBlock); ++node) {
      const int slot = m.nodes.slot_of_node[node];
      const Eigen::Vector3d relative =
          slot < m.nodes.free_count
              ? Eigen::Vector3d(m.nodes.diagonal * m.nodes.places[slot].now.head<3>().cast<double>())
              : m.held_positions[slot - m.nodes.free_count];
      positions.row(node) = (m.origin + relative).transpose();
    }
  });
}

std::size_t FrameSolver::bytes() const {
  const Members& m = *members_;
  const auto slots = static_cast<std::size_t>(m.nodes.slot_count);
  return slots * (sizeof(NodeRecord) + sizeof(NodePlace) + 4 * sizeof(int)) +
         m.rotations.size() * (sizeof(Eigen::Quaternionf) + 2 * sizeof(float)) +
         m.nodes.links.size() * sizeof(int) + m.nodes.weights.size() * sizeof(float) +
         m.nodes.half_rest_differences.size() * sizeof(Eigen::Vector4f) +
         m.nodes.runs.size() * sizeof(LatticeRun) + m.blends.bytes() + m.starts.bytes();
}

}  // namespace sinew
