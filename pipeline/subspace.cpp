// After [Shi et al. 2006, eq. 11], whose right-hand side is linear in the rotations; the modes are an
// addition.
#include "pipeline/subspace.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <numeric>
#include <utility>

#include "pipeline/rig.h"
#include "pipeline/rotation_field.h"
#include "solver/wide.h"

namespace sinew {
namespace {

/// Modes solved side by side, as many as the passes over the matrix can share without spilling.
constexpr int kModesAtOnce = 8;

/// Relative residual of the modes: they are summed with weights near one.
constexpr double kModeTolerance = 1e-5;

/// Enough for solvers whose cycles are single iterations.
constexpr int kMostCycles = 2000;

/// Smaller numbers, shares of the diagonal, are not kept.
constexpr float kDropBelow = 2e-5f;

/// An arm that leaves its bone's axis by less than this share of the diagonal turns the same with and
/// without the bone's own twist.
constexpr double kOnAxis = 1e-7;

/// Nodes per block of parallel work.
constexpr int kNodesAtOnce = 2048;

/// Vertices next to each other in the solver's order first, then those that are not solved for.
std::vector<int> surface_in_order(const Rig& rig) {
  std::vector<int> nodes;
  for (const int node : rig.node_of_free) {
    if (node < rig.volume.surface_count) nodes.push_back(node);
  }
  for (int node = 0; node < rig.volume.surface_count; ++node) {
    if (rig.free_of_node[node] < 0) nodes.push_back(node);
  }
  return nodes;
}

using Register = Wide<float, kRegisterFloats>;

}  // namespace

/// Works the modes out, and forgets what only that needs.
class Subspace::Builder {
 public:
  Builder(Subspace& subspace, const Rig& rig, ThreadTeam& team)
      : subspace_(subspace), rig_(rig), team_(team), rotations_(rig.skeleton, rig.binding) {
    held_of_node_.assign(rig.volume.node_count(), -1);
    for (int node = 0; node < rig.volume.node_count(); ++node) {
      if (rig.free_of_node[node] >= 0) continue;
      held_of_node_[node] = static_cast<int>(held_.size());
      held_.emplace_back();
    }
    choose_matrices();
    share_matrices();
    hold_nodes();
  }

  std::vector<Entry> solve() {
    const LinearSolver* const solver = rig_.solver.get();  // null where no node is free
    std::vector<Entry> entries;
    const int modes = subspace_.mode_count();
    std::unique_ptr<SolverWorkspace> workspace;
    if (solver != nullptr) workspace = solver->make_workspace(std::min(modes, kModesAtOnce));
    for (int first = 0; first < modes; first += kModesAtOnce) {
      const int count = std::min(kModesAtOnce, modes - first);
      const Columns held = held_values(first, count);
      Columns x = Columns::Zero(static_cast<Eigen::Index>(rig_.node_of_free.size()), count);
      if (solver != nullptr) {
        const Columns b = right_hand_sides(first, count, held);
        solver->solve(b, x, {.tolerance = kModeTolerance, .max_cycles = kMostCycles, .from_zero = true},
                      *workspace);
      }
      append(first, held, x, entries);
    }
    return entries;
  }

 private:
  struct Share {
    int column = 0;  ///< a matrix, or a mode
    double value = 0.0;
  };
  Eigen::Vector3d rest(int node) const { return rig_.volume.rest_positions.row(node).transpose(); }

  void choose_matrices() {
    matrix_of_joint_.assign(rig_.skeleton.joint_count(), -1);
    for (const BoneTurn& turn : rotations_.turns()) {
      const int index = static_cast<int>(matrix_of_turn_.size());
      matrix_of_turn_.push_back(static_cast<int>(subspace_.matrices_.size()));
      matrix_of_joint_[turn.joint] = matrix_of_turn_.back();
      for (std::size_t knot = 0; knot < (turn.twists ? kTwistKnots.size() : 1); ++knot)
        subspace_.matrices_.push_back({turn.joint, index, kTwistKnots[knot]});
    }
    axis_of_joint_.assign(rig_.skeleton.joint_count(), Eigen::Vector3d::Zero());
    for (const Bone& bone : rig_.binding.bones) {
      if (bone.twists) axis_of_joint_[bone.joint] = bone.axis;
    }
    own_matrix_.assign(rig_.skeleton.joint_count(), -1);
  }

  /// The matrix that turns `arm` as the joint turns it. A twisting bone's near end lacks the bone's own
  /// twist, which matters only away from its axis: then the joint's own rotation becomes a matrix.
  int matrix_turning(int joint, const Eigen::Vector3d& arm) {
    const Eigen::Vector3d& axis = axis_of_joint_[joint];
    const bool off_axis = (arm - axis.dot(arm) * axis).norm() > kOnAxis * subspace_.diagonal_;
    if (axis.isZero(0.0) || !off_axis) return matrix_of_joint_[joint];
    if (own_matrix_[joint] < 0) {
      own_matrix_[joint] = static_cast<int>(subspace_.matrices_.size());
      subspace_.matrices_.push_back({joint});
    }
    return own_matrix_[joint];
  }

  /// How much every node listens to every matrix.
  void share_matrices() {
    const HarmonicFields& fields = rig_.harmonics;
    std::vector<BlendTerm> terms;
    share_offsets_.push_back(0);
    for (int node = 0; node < rig_.volume.node_count(); ++node) {
      const int begin = fields.offsets[node];
      terms.clear();
      rotations_.append_terms(&fields.fields[begin], &fields.weights[begin], fields.offsets[node + 1] - begin,
                              terms);
      for (const BlendTerm& term : terms) share_term(term);
      share_offsets_.push_back(static_cast<int>(shares_.size()));
    }
  }

  void share_term(const BlendTerm& term) {
    const int matrix = matrix_of_turn_[term.turn];
    const double share = static_cast<double>(term.weight);
    if (!rotations_.turns()[term.turn].twists) {
      shares_.push_back({matrix, share});
      return;
    }
    const std::array<double, 3> at_knots = twist_parabolas(static_cast<double>(term.along));
    for (std::size_t knot = 0; knot < kTwistKnots.size(); ++knot) {
      shares_.push_back({matrix + static_cast<int>(knot), share * at_knots[knot]});
    }
  }

  std::span<const Share> shares(int node) const {
    return {shares_.data() + share_offsets_[node], shares_.data() + share_offsets_[node + 1]};
  }

  /// A held position as it depends on the modes, whose numbers are not settled before all matrices are
  /// known: joints count from -1 downwards.
  std::vector<Share>& held(int node) { return held_[held_of_node_[node]]; }
  static int column_of_joint(int joint) { return -1 - joint; }

  static void add_arm(int matrix, const Eigen::Vector3d& arm, double share, std::vector<Share>& to) {
    for (int axis = 0; axis < kPerMatrix; ++axis)
      to.push_back({kPerMatrix * matrix + axis, share * arm[axis]});
  }

  /// As FrameSolver pins them, with linear blends for rotations.
  void hold_nodes() {
    const double unit = 1.0 / subspace_.diagonal_;
    const auto joint_rest = [&](int joint) -> const Eigen::Vector3d& {
      return rig_.skeleton.joints[joint].position;
    };
    for (const SphereConstraint& sphere : rig_.binding.spheres) {
      std::vector<Share>& to = held(sphere.node);
      to.push_back({column_of_joint(sphere.joint), 1.0});
      const Eigen::Vector3d arm = unit * (rest(sphere.node) - joint_rest(sphere.joint));
      for (const Share& share : shares(sphere.node)) add_arm(share.column, arm, share.value, to);
    }
    for (const CoreConstraint& core : rig_.binding.cores) {
      std::vector<Share>& to = held(core.node);
      const int joint = rig_.binding.bones[core.bone].joint;
      Eigen::Vector3d arm = core.foot - joint_rest(joint);
      to.push_back({column_of_joint(joint), 1.0});
      if (core.end_joint >= 0) {
        arm -= core.along * (joint_rest(core.end_joint) - joint_rest(joint));
        to.back().value = 1.0 - core.along;
        to.push_back({column_of_joint(core.end_joint), core.along});
      }
      add_arm(matrix_turning(joint, arm), unit * arm, 1.0, to);
      const Eigen::Vector3d from_foot = unit * (rest(core.node) - core.foot);
      for (const Share& share : shares(core.node)) add_arm(share.column, from_foot, share.value, to);
    }
    for (const auto& [node, bone] : rig_.binding.glued) {
      std::vector<Share>& to = held(node);
      const int joint = rig_.binding.bones[bone].joint;
      const Eigen::Vector3d arm = rest(node) - joint_rest(joint);
      to.push_back({column_of_joint(joint), 1.0});
      add_arm(matrix_turning(joint, arm), unit * arm, 1.0, to);
    }
  }

  /// Modes [first, first + count) at the held nodes.
  Columns held_values(int first, int count) const {
    Columns values = Columns::Zero(static_cast<Eigen::Index>(held_.size()), count);
    const int joints_begin = kPerMatrix * static_cast<int>(subspace_.matrices_.size());
    for (std::size_t row = 0; row < held_.size(); ++row) {
      for (const Share& share : held_[row]) {
        const int mode = share.column < 0 ? joints_begin - 1 - share.column : share.column;
        if (mode >= first && mode < first + count) {
          values(static_cast<Eigen::Index>(row), mode - first) += share.value;
        }
      }
    }
    return values;
  }

  /// sum_j w 1/2 (h_i + h_j) (x0_i - x0_j) for the modes of matrices, and the held neighbors' values.
  Columns right_hand_sides(int first, int count, const Columns& held) const {
    const int first_matrix = first / kPerMatrix;
    const int matrix_count =
        std::min((first + count - 1) / kPerMatrix + 1, static_cast<int>(subspace_.matrices_.size())) -
        first_matrix;
    Columns listening = Columns::Zero(rig_.volume.node_count(), std::max(matrix_count, 0));
    for (int node = 0; node < rig_.volume.node_count(); ++node) {
      for (const Share& share : shares(node)) {
        const int column = share.column - first_matrix;
        if (column >= 0 && column < matrix_count) listening(node, column) += share.value;
      }
    }
    const int free_count = static_cast<int>(rig_.node_of_free.size());
    Columns b = Columns::Zero(free_count, count);
    team_.for_each_block((free_count + kNodesAtOnce - 1) / kNodesAtOnce, [&](int block) {
      const int end = std::min(free_count, (block + 1) * kNodesAtOnce);
      for (int free = block * kNodesAtOnce; free < end; ++free) add_row(free, first, held, listening, b);
    });
    return b;
  }

  void add_row(int free, int first, const Columns& held, const Columns& listening, Columns& b) const {
    const Graph& graph = rig_.volume.graph;
    const int node = rig_.node_of_free[free];
    const int first_matrix = first / kPerMatrix;
    const int joints_begin = kPerMatrix * static_cast<int>(subspace_.matrices_.size());
    const int columns = static_cast<int>(b.cols());
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
      const int neighbor = graph.neighbors[k];
      const Eigen::Vector3d edge =
          graph.weights[k] / (2.0 * subspace_.diagonal_) * (rest(node) - rest(neighbor));
      for (int column = 0; column < columns && first + column < joints_begin; ++column) {
        const int matrix = (first + column) / kPerMatrix - first_matrix;
        b(free, column) +=
            (listening(node, matrix) + listening(neighbor, matrix)) * edge[(first + column) % kPerMatrix];
      }
      const int row = held_of_node_[neighbor];
      if (row < 0) continue;
      for (int column = 0; column < columns; ++column)
        b(free, column) += graph.weights[k] * held(row, column);
    }
  }

  /// Keeps what counts of solved modes.
  void append(int first, const Columns& held, const Columns& x, std::vector<Entry>& entries) const {
    for (int block = 0; block < subspace_.block_count(); ++block) {
      const int begin = block * kBlock;
      const int rows = std::min(kBlock, subspace_.row_count_ - begin);
      for (int column = 0; column < x.cols(); ++column) {
        Entry entry{block, first + column, {}};
        float largest = 0.0f;
        for (int row = 0; row < rows; ++row) {
          const int node = subspace_.nodes_[begin + row];
          const int free = rig_.free_of_node[node];
          const double value = free >= 0 ? x(free, column) : held(held_of_node_[node], column);
          entry.values.of_row[row] = static_cast<float>(value);
          largest = std::max(largest, std::abs(entry.values.of_row[row]));
        }
        if (largest > kDropBelow) entries.push_back(entry);
      }
    }
  }

  Subspace& subspace_;
  const Rig& rig_;
  ThreadTeam& team_;
  PoseRotations rotations_;

  std::vector<int> held_of_node_;  // -1 where free
  std::vector<int> matrix_of_turn_;             // the first of its bone
  std::vector<int> matrix_of_joint_;            // likewise; -1: none
  std::vector<int> own_matrix_;                 // per joint; -1: none
  std::vector<Eigen::Vector3d> axis_of_joint_;  // zero: does not twist
  std::vector<int> share_offsets_;              // per node
  std::vector<Share> shares_;
  std::vector<std::vector<Share>> held_;  // per held node
};

Subspace::Subspace(const Rig& rig, SubspaceOf of, ThreadTeam& team)
    : of_(of),
      diagonal_(rest_diagonal(rig.volume)),
      joint_count_(rig.skeleton.joint_count()),
      nodes_(of == SubspaceOf::surface ? surface_in_order(rig) : rig.node_of_free) {
  row_count_ = static_cast<int>(nodes_.size());
  keep(Builder(*this, rig, team).solve());
}

Subspace::Subspace(const Subspace& all, std::span<const int> rows)
    : diagonal_(all.diagonal_),
      row_count_(static_cast<int>(rows.size())),
      joint_count_(all.joint_count_),
      matrices_(all.matrices_) {
  std::vector<Entry> entries;
  for (int block = 0; block < block_count(); ++block) {
    const std::size_t begin = entries.size();
    for (int row = block * kBlock; row < std::min(row_count_, (block + 1) * kBlock); ++row) {
      const int from = rows[row] / kBlock;
      for (int k = all.offsets_[from]; k < all.offsets_[from + 1]; ++k) {
        const int mode = all.modes_[k];
        const auto same = [&](const Entry& entry) { return entry.mode == mode; };
        auto entry = std::find_if(entries.begin() + static_cast<std::ptrdiff_t>(begin), entries.end(), same);
        if (entry == entries.end()) entry = entries.insert(entry, Entry{block, mode, {}});
        entry->values.of_row[row % kBlock] = all.values_[k].of_row[rows[row] % kBlock];
      }
    }
  }
  keep(entries);
}

/// Block after block, the order within a block kept.
void Subspace::keep(const std::vector<Entry>& entries) {
  offsets_.assign(block_count() + 1, 0);
  for (const Entry& entry : entries) ++offsets_[entry.block + 1];
  std::partial_sum(offsets_.begin(), offsets_.end(), offsets_.begin());
  modes_.resize(entries.size());
  values_.resize(entries.size());
  std::vector<int> next(offsets_.begin(), offsets_.end() - 1);
  for (const Entry& entry : entries) {
    const int place = next[entry.block]++;
    modes_[place] = entry.mode;
    values_[place] = entry.values;
  }
}

void Subspace::read(const Pose& pose, const PoseRotations& rotations, Eigen::VectorXf& coordinates) const {
  Eigen::Map<Eigen::Matrix3Xf> columns(coordinates.data(), 3, mode_count());
  int mode = 0;
  for (const Matrix& matrix : matrices_) {
    const Eigen::Matrix3d turn = matrix.turn < 0 ? pose.rotations[matrix.joint].toRotationMatrix()
                                                 : rotations.matrix_at(matrix.turn, matrix.along);
    columns.middleCols<kPerMatrix>(mode) = (pose.scales[matrix.joint] * turn).cast<float>();
    mode += kPerMatrix;
  }
  for (int joint = 0; joint < joint_count_; ++joint) {
    columns.col(mode++) = ((pose.positions[joint] - pose.positions.front()) / diagonal_).cast<float>();
  }
}

void Subspace::evaluate(int block, const Eigen::VectorXf& coordinates, Eigen::Vector4f* rows) const {
  constexpr int vectors = kBlock / kRegisterFloats;
  Register sum[3][vectors] = {};
  for (int k = offsets_[block]; k < offsets_[block + 1]; ++k) {
    const float* const coordinate = coordinates.data() + 3 * modes_[k];
    for (int v = 0; v < vectors; ++v) {
      const Register value = loaded<Register>(values_[k].of_row + kRegisterFloats * v);
      for (int axis = 0; axis < 3; ++axis) sum[axis][v] += coordinate[axis] * value;
    }
  }
  const int count = std::min(kBlock, row_count_ - block * kBlock);
  alignas(64) float coordinates_of_rows[3][kBlock];
  for (int axis = 0; axis < 3; ++axis) {
    for (int v = 0; v < vectors; ++v) store(sum[axis][v], coordinates_of_rows[axis] + kRegisterFloats * v);
  }
  for (int row = 0; row < count; row += 4) {
    Wide<float, 4> four[4] = {};
    for (int axis = 0; axis < 3; ++axis) four[axis] = loaded<Wide<float, 4>>(coordinates_of_rows[axis] + row);
    transpose(four[0], four[1], four[2], four[3]);
    for (int k = 0; k < std::min(4, count - row); ++k) store(four[k], rows[row + k].data());
  }
}

std::size_t Subspace::bytes() const {
  return values_.size() * sizeof(Values) + (modes_.size() + offsets_.size() + nodes_.size()) * sizeof(int);
}

}  // namespace sinew
