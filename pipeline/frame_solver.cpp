// Both passes of a frame: [Shi et al. 2006, sections 2 and 7], the local/global iterations after
// [Sorkine and Alexa 2007], the accumulated volume scale an addition of this project.
#include "pipeline/frame_solver.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/local_step.h"
#include "pipeline/rotation_field.h"

namespace sinew {
namespace {

/// Nodes per block of parallel work, a multiple of kFitLanes: some tens of microseconds each.
constexpr int kBlock = 2048;
static_assert(kBlock % kFitLanes == 0);

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

/// What an edge needs of a node for the right-hand side, in one cache line.
struct alignas(64) Turn {
  Eigen::Vector4f column[3];  ///< of scale times rotation; the fourth numbers are 0
  Eigen::Vector4f rest;       ///< rest position, a share of the rest box's diagonal from its middle; then 0
};

/// What an edge needs of a node for the local step.
struct alignas(32) Place {
  Eigen::Vector4f rest;  ///< as in Turn
  Eigen::Vector4f now;   ///< position now, in the same unit, relative to the pose's first joint
};

void set_columns(const Eigen::Matrix3f& matrix, Turn& turn) {
  for (int axis = 0; axis < 3; ++axis) turn.column[axis].head<3>() = matrix.col(axis);
}

Eigen::Vector3d turned(const Turn& turn, const Eigen::Vector3d& arm) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) sum += arm[axis] * turn.column[axis].head<3>().cast<double>();
  return sum;
}

Eigen::Vector4f with_zero(const Eigen::Vector3d& vector) {
  Eigen::Vector4f four = Eigen::Vector4f::Zero();
  four.head<3>() = vector.cast<float>();
  return four;
}

/// Nodes are renumbered into slots: the free ones in the solver's order, then the constrained ones.
///
/// Edges are handled in single precision as differences of positions that are shares of the body's
/// diagonal: both ends of an edge see the same difference, so rounding bends the rest shape by 6e-8 of the
/// diagonal and no more. Positions and right-hand sides are double.
struct FrameSolver::Members {
  Members(const Rig& rig_in, const FrameOptions& options_in, ThreadTeam& team_in);

  FrameReport solve(const Pose& pose, Field3& positions, bool from_zero);

  const Rig& rig;
  FrameOptions options;
  ThreadTeam& team;

  double diagonal = 1.0;         // of the rest box
  int free_count = 0;
  int slot_count = 0;
  std::vector<int> node_of_slot;
  std::vector<int> slot_of_node;
  std::vector<int> offsets;      // per free slot, into neighbors and weights
  std::vector<int> neighbors;    // slots, ascending: the held ones last
  std::vector<float> weights;    // empty where all are one
  std::vector<float> inverse_rest_determinants;  // per free slot, of sum w e e^T; 0 where flat
  std::vector<bool> given;       // per free slot: in a bone's cylinder, its rotation is the bone's

  PoseRotations pose_rotations;
  std::vector<int> term_offsets;                // per slot, into terms
  std::vector<BlendTerm> terms;
  std::vector<Turn> turns;                      // per slot
  std::vector<Place> places;                    // per slot
  std::vector<Eigen::Quaternionf> rotations;    // per slot
  std::vector<float> pose_scales;               // per slot
  std::vector<float> volume_scales;             // per free slot
  Columns x;  // slot_count x 3, relative to the pose's first joint
  Columns b;  // free_count x 3
  std::unique_ptr<SolverWorkspace> workspace;

 private:
  void number_slots();
  void copy_neighborhoods();
  void measure_rest();
  void copy_terms();
  template <typename Body>
  void for_each_block(std::size_t count, const Body& body);

  void blend(const Pose& pose);
  void begin(const Field3& positions, const Eigen::Vector3d& origin);
  void pin(const Pose& pose, const Eigen::Vector3d& origin);
  Eigen::Vector3d core_place(const Pose& pose, const CoreConstraint& core) const;
  template <bool kUniform>
  Eigen::Vector3d right_hand_side(int slot) const;
  void build_right_hand_side();
  template <bool kUniform>
  void sum_edges(int slot, int lane, FitBatch& batch) const;
  void fit_locally();
  void fit_batch(int first, int count);
  void run_solver(bool from_zero, FrameReport& report);
};

FrameSolver::Members::Members(const Rig& rig_in, const FrameOptions& options_in, ThreadTeam& team_in)
    : rig(rig_in), options(options_in), team(team_in), pose_rotations(rig_in.skeleton, rig_in.binding) {
  number_slots();
  rotations.assign(slot_count, Eigen::Quaternionf::Identity());
  pose_scales.assign(slot_count, 1.0f);
  volume_scales.assign(free_count, 1.0f);
  measure_rest();
  copy_neighborhoods();
  copy_terms();
  given.assign(free_count, false);
  for (const FieldConstraint& constraint : rig.binding.field_constraints) {
    const int slot = slot_of_node[constraint.node];
    if (slot < free_count) given[slot] = true;
  }
  x = Columns::Zero(slot_count, 3);
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

void FrameSolver::Members::measure_rest() {
  Eigen::AlignedBox3d box;
  for (int node = 0; node < slot_count; ++node) box.extend(rig.volume.rest_positions.row(node).transpose());
  if (slot_count > 0 && box.diagonal().norm() > 0.0) diagonal = box.diagonal().norm();
  turns.resize(slot_count);
  places.resize(slot_count);
  for (int slot = 0; slot < slot_count; ++slot) {
    const Eigen::Vector3d rest = rig.volume.rest_positions.row(node_of_slot[slot]).transpose();
    for (Eigen::Vector4f& column : turns[slot].column) column.setZero();
    turns[slot].rest = with_zero((rest - box.center()) / diagonal);
    places[slot] = {turns[slot].rest, turns[slot].rest};
  }
}

void FrameSolver::Members::copy_neighborhoods() {
  const Graph& graph = rig.volume.graph;
  const bool uniform = std::all_of(graph.weights.begin(), graph.weights.end(), [](double w) { return w == 1.0; });
  std::vector<std::pair<int, double>> around;
  offsets.push_back(0);
  for (int slot = 0; slot < free_count; ++slot) {
    const int node = node_of_slot[slot];
    around.clear();
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
      around.emplace_back(slot_of_node[graph.neighbors[k]], graph.weights[k]);
      const Eigen::Vector3d edge = (turns[slot].rest - turns[around.back().first].rest).head<3>().cast<double>();
      spread += graph.weights[k] * edge * edge.transpose();
    }
    std::sort(around.begin(), around.end());
    for (const auto& [neighbor, weight] : around) {
      neighbors.push_back(neighbor);
      if (!uniform) weights.push_back(static_cast<float>(weight));
    }
    offsets.push_back(static_cast<int>(neighbors.size()));
    const double determinant = spread.determinant();
    const double even = std::pow(spread.trace() / 3.0, 3);
    inverse_rest_determinants.push_back(determinant > kFlat * even ? static_cast<float>(1.0 / determinant) : 0.0f);
  }
}

/// Calls body(first, end) for blocks of [0, count).
template <typename Body>
void FrameSolver::Members::for_each_block(std::size_t count, const Body& body) {
  const int size = static_cast<int>(count);
  team.for_each_block((size + kBlock - 1) / kBlock, [&](int block) {
    body(block * kBlock, std::min(size, (block + 1) * kBlock));
  });
}

void FrameSolver::Members::copy_terms() {
  const HarmonicFields& fields = rig.harmonics;
  term_offsets.push_back(0);
  for (const int node : node_of_slot) {
    const int begin = fields.offsets[node];
    const int count = fields.offsets[node + 1] - begin;
    pose_rotations.append_terms(&fields.fields[begin], &fields.weights[begin], count, terms);
    term_offsets.push_back(static_cast<int>(terms.size()));
  }
  terms.shrink_to_fit();
}

void FrameSolver::Members::blend(const Pose& pose) {
  pose_rotations.read(pose);
  const HarmonicFields& fields = rig.harmonics;
  for_each_block(slot_count, [&](int first, int end) {
    for (int slot = first; slot < end; ++slot) {
      const std::size_t count = term_offsets[slot + 1] - term_offsets[slot];
      rotations[slot] = pose_rotations.blend({&terms[term_offsets[slot]], count});
      float scale = 1.0f;
      if (!pose_rotations.rigid()) {
        const int row = fields.offsets[node_of_slot[slot]];
        const int fields_here = fields.offsets[node_of_slot[slot] + 1] - row;
        scale = pose_rotations.blend_scale(&fields.fields[row], &fields.weights[row], fields_here);
      }
      pose_scales[slot] = scale;
      set_columns(scale * rotations[slot].toRotationMatrix(), turns[slot]);
    }
  });
}

/// The first guess, and no volume correction yet.
void FrameSolver::Members::begin(const Field3& positions, const Eigen::Vector3d& origin) {
  for_each_block(free_count, [&](int first, int end) {
    for (int slot = first; slot < end; ++slot) {
      x.row(slot) = positions.row(node_of_slot[slot]) - origin.transpose();
      volume_scales[slot] = 1.0f;
    }
  });
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
  const Binding& binding = rig.binding;
  const auto rest = [&](int node) -> Eigen::Vector3d { return rig.volume.rest_positions.row(node).transpose(); };
  for_each_block(binding.spheres.size(), [&](int first, int end) {
    for (int k = first; k < end; ++k) {
      const SphereConstraint& sphere = binding.spheres[k];
      const int slot = slot_of_node[sphere.node];
      const Eigen::Vector3d arm = rest(sphere.node) - rig.skeleton.joints[sphere.joint].position;
      x.row(slot) = (pose.positions[sphere.joint] - origin + turned(turns[slot], arm)).transpose();
    }
  });
  for_each_block(binding.cores.size(), [&](int first, int end) {
    for (int k = first; k < end; ++k) {
      const CoreConstraint& core = binding.cores[k];
      const int slot = slot_of_node[core.node];
      x.row(slot) = (core_place(pose, core) - origin + turned(turns[slot], rest(core.node) - core.foot)).transpose();
    }
  });
  for_each_block(binding.glued.size(), [&](int first, int end) {
    for (int k = first; k < end; ++k) {
      const auto& [node, bone] = binding.glued[k];
      const int joint = binding.bones[bone].joint;
      const Eigen::Vector3d arm = pose.scales[joint] * (rest(node) - rig.skeleton.joints[joint].position);
      x.row(slot_of_node[node]) = (pose.positions[joint] - origin + pose.rotations[joint] * arm).transpose();
    }
  });
  for_each_block(slot_count - free_count, [&](int first, int end) {
    for (int held = first; held < end; ++held) {
      const int slot = free_count + held;
      places[slot].now = with_zero(x.row(slot).transpose() / diagonal);
    }
  });
}

template <bool kUniform>
Eigen::Vector3d FrameSolver::Members::right_hand_side(int slot) const {
  // sum_j w d_ji = 1/2 s_i R_i sum_j w e_ij + 1/2 sum_j w s_j R_j e_ij
  const Turn& own = turns[slot];
  Eigen::Vector4f edges = Eigen::Vector4f::Zero();
  Eigen::Vector4f wanted = Eigen::Vector4f::Zero();
  for (int k = offsets[slot]; k < offsets[slot + 1]; ++k) {
    const Turn& other = turns[neighbors[k]];
    Eigen::Vector4f edge = own.rest - other.rest;
    if constexpr (!kUniform) edge *= weights[k];
    edges += edge;
    wanted += edge[0] * other.column[0] + edge[1] * other.column[1] + edge[2] * other.column[2];
  }
  wanted += edges[0] * own.column[0] + edges[1] * own.column[1] + edges[2] * own.column[2];
  Eigen::Vector3d sum = 0.5 * diagonal * wanted.head<3>().cast<double>();
  for (int k = offsets[slot + 1] - 1; k >= offsets[slot] && neighbors[k] >= free_count; --k) {
    const double weight = kUniform ? 1.0 : static_cast<double>(weights[k]);
    sum += weight * x.row(neighbors[k]).transpose();
  }
  return sum;
}

void FrameSolver::Members::build_right_hand_side() {
  for_each_block(free_count, [&](int first, int end) {
    for (int slot = first; slot < end; ++slot) {
      b.row(slot) = (weights.empty() ? right_hand_side<true>(slot) : right_hand_side<false>(slot)).transpose();
    }
  });
}

/// Fills a lane with the sum over the slot's edges of w e' e^T, e' the deformed edge.
template <bool kUniform>
void FrameSolver::Members::sum_edges(int slot, int lane, FitBatch& batch) const {
  const Place& own = places[slot];
  Eigen::Vector4f columns[3] = {Eigen::Vector4f::Zero(), Eigen::Vector4f::Zero(), Eigen::Vector4f::Zero()};
  for (int k = offsets[slot]; k < offsets[slot + 1]; ++k) {
    const Place& other = places[neighbors[k]];
    Eigen::Vector4f edge = own.rest - other.rest;
    if constexpr (!kUniform) edge *= weights[k];
    const Eigen::Vector4f deformed = own.now - other.now;
    for (int axis = 0; axis < 3; ++axis) columns[axis] += edge[axis] * deformed;
  }
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) batch.sum[3 * row + column][lane] = columns[column][row];
  }
}

void FrameSolver::Members::fit_batch(int first, int count) {
  FitBatch batch{};
  alignas(64) float determinants[kFitLanes] = {};
  alignas(64) float scales[kFitLanes] = {};
  for (int lane = 0; lane < count; ++lane) {
    const int slot = first + lane;
    weights.empty() ? sum_edges<true>(slot, lane, batch) : sum_edges<false>(slot, lane, batch);
    for (int k = 0; k < 4; ++k) batch.rotation[k][lane] = rotations[slot].coeffs()[k];
    const float pose_scale = pose_scales[slot];
    determinants[lane] = inverse_rest_determinants[slot] / (pose_scale * pose_scale * pose_scale);
    scales[lane] = volume_scales[slot];
  }
  for (int lane = count; lane < kFitLanes; ++lane) batch.rotation[3][lane] = 1.0f;
  fit_rotations(batch);
  if (options.volume_gain != 0.0) {
    correct_volume(batch, determinants, static_cast<float>(options.volume_gain), scales);
  }
  for (int lane = 0; lane < count; ++lane) {
    const int slot = first + lane;
    if (given[slot]) {
      for (int k = 0; k < 4; ++k) batch.rotation[k][lane] = rotations[slot].coeffs()[k];
    }
    for (int k = 0; k < 4; ++k) rotations[slot].coeffs()[k] = batch.rotation[k][lane];
    volume_scales[slot] = scales[lane];
  }
  alignas(64) float matrices[9][kFitLanes];
  rotation_matrices(batch, matrices);
  for (int lane = 0; lane < count; ++lane) {
    const int slot = first + lane;
    const float scale = pose_scales[slot] * volume_scales[slot];
    for (int axis = 0; axis < 3; ++axis) {
      for (int row = 0; row < 3; ++row) turns[slot].column[axis][row] = scale * matrices[3 * row + axis][lane];
    }
  }
}

void FrameSolver::Members::fit_locally() {
  for_each_block(free_count, [&](int first, int end) {
    for (int slot = first; slot < end; ++slot) places[slot].now = with_zero(x.row(slot).transpose() / diagonal);
  });
  for_each_block(free_count, [&](int first, int end) {
    for (int slot = first; slot < end; slot += kFitLanes) fit_batch(slot, std::min(kFitLanes, end - slot));
  });
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
    begin(positions, origin);
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
  for_each_block(slot_count, [&](int first, int end) {
    for (int slot = first; slot < end; ++slot) positions.row(node_of_slot[slot]) = x.row(slot) + origin.transpose();
  });
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
