// Both passes of a frame: [Shi et al. 2006, sections 2 and 7], the local/global iterations after
// [Sorkine and Alexa 2007], the accumulated volume scale an addition of this project.
#include "pipeline/frame_solver.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <vector>

#include "pipeline/local_step.h"
#include "pipeline/rotation_field.h"

namespace sinew {
namespace {

/// Nodes per block of parallel work: some tens of microseconds each.
constexpr int kBlock = 2048;

/// The volume scale stays within this factor of the pose's own scale.
constexpr double kMostScale = 1.3;

/// Local volume ratios are trusted within this factor; outside it a neighborhood is crushed or turned
/// inside out, and says only which way to go.
constexpr double kMostVolumeRatio = 8.0;

/// A neighborhood flatter than this share of an even one has no volume to speak of.
constexpr double kFlat = 1e-3;

using Clock = std::chrono::steady_clock;

double milliseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

}  // namespace

const char* stage_name(FrameStage stage) {
  constexpr std::array<const char*, kFrameStageCount> names = {"rotations", "right_hand_side", "solve", "local"};
  return names[static_cast<int>(stage)];
}

/// Nodes are renumbered into slots: the free ones in the solver's order, then the constrained ones.
struct FrameSolver::Members {
  Members(const Rig& rig_in, const FrameOptions& options_in, ThreadTeam& team_in);

  FrameReport solve(const Pose& pose, Field3& positions, bool from_zero);

  const Rig& rig;
  FrameOptions options;
  ThreadTeam& team;

  int free_count = 0;
  int slot_count = 0;
  std::vector<int> node_of_slot;
  std::vector<int> slot_of_node;
  std::vector<int> offsets;     // per free slot, into neighbors and weights
  std::vector<int> neighbors;   // slots
  std::vector<double> weights;
  Field3 rest;                  // per slot
  Field3 rest_sum;              // per free slot: sum over neighbors of w (x0_i - x0_j)
  std::vector<double> inverse_rest_determinant;  // per free slot, of sum w e e'; 0 where flat
  std::vector<bool> turned;     // per free slot: in a bone's cylinder, its rotation given

  PoseRotations pose_rotations;
  std::vector<Eigen::Quaterniond> rotations;  // per slot
  std::vector<double> pose_scales;            // per slot
  std::vector<double> volume_scales;          // per free slot
  std::vector<Eigen::Matrix3d> turns;         // per slot: scale times rotation
  Columns x;  // slot_count x 3, relative to the pose's first joint
  Columns b;  // free_count x 3
  std::unique_ptr<SolverWorkspace> workspace;

 private:
  void number_slots();
  void copy_neighborhoods();
  void measure_rest();
  template <typename Body>
  void for_each_slot(int count, const Body& body);

  void blend(const Pose& pose);
  void pin(const Pose& pose, const Eigen::Vector3d& origin);
  Eigen::Vector3d core_place(const Pose& pose, const CoreConstraint& core) const;
  Eigen::Vector3d right_hand_side(int slot) const;
  void build_right_hand_side();
  void fit_locally();
  void fit_slot(int slot);
  void run_solver(bool from_zero, FrameReport& report);
};

FrameSolver::Members::Members(const Rig& rig_in, const FrameOptions& options_in, ThreadTeam& team_in)
    : rig(rig_in), options(options_in), team(team_in), pose_rotations(rig_in.skeleton, rig_in.binding) {
  number_slots();
  copy_neighborhoods();
  measure_rest();
  turned.assign(free_count, false);
  for (const FieldConstraint& constraint : rig.binding.field_constraints) {
    const int slot = slot_of_node[constraint.node];
    if (slot < free_count) turned[slot] = true;
  }
  rotations.assign(slot_count, Eigen::Quaterniond::Identity());
  pose_scales.assign(slot_count, 1.0);
  volume_scales.assign(free_count, 1.0);
  turns.assign(slot_count, Eigen::Matrix3d::Identity());
  x = rest;
  b = Columns::Zero(free_count, 3);
  if (rig.solver) workspace = rig.solver->make_workspace(3);
}

void FrameSolver::Members::number_slots() {
  free_count = static_cast<int>(rig.node_of_free.size());
  slot_count = rig.volume.node_count();
  node_of_slot = rig.node_of_free;
  for (int node = 0; node < slot_count; ++node) {
    if (rig.free_of_node[node] < 0) node_of_slot.push_back(node);
  }
  slot_of_node.resize(slot_count);
  for (int slot = 0; slot < slot_count; ++slot) slot_of_node[node_of_slot[slot]] = slot;
}

void FrameSolver::Members::copy_neighborhoods() {
  const Graph& graph = rig.volume.graph;
  offsets.push_back(0);
  for (int slot = 0; slot < free_count; ++slot) {
    const int node = node_of_slot[slot];
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
      neighbors.push_back(slot_of_node[graph.neighbors[k]]);
      weights.push_back(graph.weights[k]);
    }
    offsets.push_back(static_cast<int>(neighbors.size()));
  }
}

void FrameSolver::Members::measure_rest() {
  rest.resize(slot_count, 3);
  for (int slot = 0; slot < slot_count; ++slot) rest.row(slot) = rig.volume.rest_positions.row(node_of_slot[slot]);
  rest_sum.resize(free_count, 3);
  inverse_rest_determinant.resize(free_count);
  for (int slot = 0; slot < free_count; ++slot) {
    Eigen::RowVector3d sum = Eigen::RowVector3d::Zero();
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (int k = offsets[slot]; k < offsets[slot + 1]; ++k) {
      const Eigen::RowVector3d edge = rest.row(slot) - rest.row(neighbors[k]);
      sum += weights[k] * edge;
      spread += weights[k] * edge.transpose() * edge;
    }
    rest_sum.row(slot) = sum;
    const double determinant = spread.determinant();
    const double even = std::pow(spread.trace() / 3.0, 3);
    inverse_rest_determinant[slot] = determinant > kFlat * even ? 1.0 / determinant : 0.0;
  }
}

template <typename Body>
void FrameSolver::Members::for_each_slot(int count, const Body& body) {
  team.for_each_block((count + kBlock - 1) / kBlock, [&](int block) {
    const int end = std::min(count, (block + 1) * kBlock);
    for (int slot = block * kBlock; slot < end; ++slot) body(slot);
  });
}

void FrameSolver::Members::blend(const Pose& pose) {
  pose_rotations.read(pose);
  const HarmonicFields& fields = rig.harmonics;
  for_each_slot(slot_count, [&](int slot) {
    const int begin = fields.offsets[node_of_slot[slot]];
    const int count = fields.offsets[node_of_slot[slot] + 1] - begin;
    rotations[slot] = pose_rotations.blend(&fields.fields[begin], &fields.weights[begin], count);
    turns[slot] = rotations[slot].toRotationMatrix();
    if (pose_rotations.rigid()) return;
    pose_scales[slot] = pose_rotations.blend_scale(&fields.fields[begin], &fields.weights[begin], count);
    turns[slot] *= pose_scales[slot];
  });
  if (pose_rotations.rigid()) std::fill(pose_scales.begin(), pose_scales.end(), 1.0);
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

void FrameSolver::Members::pin(const Pose& pose, const Eigen::Vector3d& origin) {
  for (const SphereConstraint& sphere : rig.binding.spheres) {
    const int slot = slot_of_node[sphere.node];
    const Eigen::Vector3d arm = rest.row(slot).transpose() - rig.skeleton.joints[sphere.joint].position;
    x.row(slot) = (pose.positions[sphere.joint] - origin + turns[slot] * arm).transpose();
  }
  for (const CoreConstraint& core : rig.binding.cores) {
    const int slot = slot_of_node[core.node];
    const Eigen::Vector3d arm = rest.row(slot).transpose() - core.foot;
    x.row(slot) = (core_place(pose, core) - origin + turns[slot] * arm).transpose();
  }
  for (const auto& [node, bone] : rig.binding.glued) {
    const int slot = slot_of_node[node];
    const int joint = rig.binding.bones[bone].joint;
    const Eigen::Vector3d arm = rest.row(slot).transpose() - rig.skeleton.joints[joint].position;
    x.row(slot) = (pose.positions[joint] - origin + pose.scales[joint] * (pose.rotations[joint] * arm)).transpose();
  }
}

Eigen::Vector3d FrameSolver::Members::right_hand_side(int slot) const {
  // sum_j w d_ji = 1/2 s_i R_i sum_j w e_ij + 1/2 sum_j w s_j R_j e_ij
  Eigen::Vector3d turned_edges = turns[slot] * rest_sum.row(slot).transpose();
  Eigen::Vector3d held = Eigen::Vector3d::Zero();
  for (int k = offsets[slot]; k < offsets[slot + 1]; ++k) {
    const int other = neighbors[k];
    turned_edges += weights[k] * (turns[other] * (rest.row(slot) - rest.row(other)).transpose());
    if (other >= free_count) held += weights[k] * x.row(other).transpose();
  }
  return 0.5 * turned_edges + held;
}

void FrameSolver::Members::build_right_hand_side() {
  for_each_slot(free_count, [&](int slot) { b.row(slot) = right_hand_side(slot).transpose(); });
}

void FrameSolver::Members::fit_slot(int slot) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();  // of w e' e^T, e' the deformed edge
  for (int k = offsets[slot]; k < offsets[slot + 1]; ++k) {
    const Eigen::Vector3d deformed = (x.row(slot) - x.row(neighbors[k])).transpose();
    sum += weights[k] * deformed * (rest.row(slot) - rest.row(neighbors[k]));
  }
  if (!turned[slot]) rotations[slot] = closest_rotation(sum, rotations[slot]);
  if (inverse_rest_determinant[slot] > 0.0 && options.volume_gain != 0.0) {
    const double ratio = sum.determinant() * inverse_rest_determinant[slot] / std::pow(pose_scales[slot], 3);
    const double trusted = std::clamp(ratio, 1.0 / kMostVolumeRatio, kMostVolumeRatio);
    const double scale = volume_scales[slot] * std::pow(trusted, -options.volume_gain / 3.0);
    volume_scales[slot] = std::clamp(scale, 1.0 / kMostScale, kMostScale);
  }
  turns[slot] = pose_scales[slot] * volume_scales[slot] * rotations[slot].toRotationMatrix();
}

void FrameSolver::Members::fit_locally() {
  for_each_slot(free_count, [&](int slot) { fit_slot(slot); });
}

void FrameSolver::Members::run_solver(bool from_zero, FrameReport& report) {
  ++report.solves;
  if (free_count == 0) return;
  SolveOptions solve = options.solve;
  solve.from_zero = from_zero;
  const SolveReport one = rig.solver->solve(b, x.topRows(free_count), solve, *workspace);
  report.cycles += one.cycles;
  report.residual = one.residual;
  report.converged = report.converged && one.converged;
}

FrameReport FrameSolver::Members::solve(const Pose& pose, Field3& positions, bool from_zero) {
  if (pose.joint_count() != rig.skeleton.joint_count() || positions.rows() != slot_count) {
    throw std::invalid_argument("FrameSolver::solve: got " + std::to_string(pose.joint_count()) + " joints and " +
                                std::to_string(positions.rows()) + " nodes; the rig has " +
                                std::to_string(rig.skeleton.joint_count()) + " and " + std::to_string(slot_count));
  }
  FrameReport report;
  report.converged = true;
  const auto timed = [&](FrameStage stage, const auto& step) {
    const Clock::time_point start = Clock::now();
    step();
    report.milliseconds[static_cast<int>(stage)] += milliseconds_since(start);
  };
  const Eigen::Vector3d origin = pose.positions.front();
  timed(FrameStage::rotations, [&] { blend(pose); });
  timed(FrameStage::right_hand_side, [&] {
    for_each_slot(free_count, [&](int slot) {
      x.row(slot) = positions.row(node_of_slot[slot]) - origin.transpose();
      volume_scales[slot] = 1.0;
    });
    pin(pose, origin);
    build_right_hand_side();
  });
  timed(FrameStage::solve, [&] { run_solver(from_zero, report); });
  const int iterations = options.deform == Deform::refined ? options.local_global : 0;
  for (int iteration = 0; iteration < iterations; ++iteration) {
    timed(FrameStage::local, [&] { fit_locally(); });
    timed(FrameStage::right_hand_side, [&] { build_right_hand_side(); });
    timed(FrameStage::solve, [&] { run_solver(false, report); });
  }
  for_each_slot(slot_count, [&](int slot) { positions.row(node_of_slot[slot]) = x.row(slot) + origin.transpose(); });
  return report;
}

FrameSolver::FrameSolver(const Rig& rig, const FrameOptions& options, ThreadTeam& team)
    : members_(std::make_unique<Members>(rig, options, team)) {}
FrameSolver::~FrameSolver() = default;
FrameSolver::FrameSolver(FrameSolver&&) noexcept = default;

FrameReport FrameSolver::solve(const Pose& pose, Field3& positions) {
  return members_->solve(pose, positions, members_->options.solve.from_zero);
}

FrameReport FrameSolver::solve_afresh(const Pose& pose, Field3& positions) {
  return members_->solve(pose, positions, true);
}

}  // namespace sinew
