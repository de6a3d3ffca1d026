#include "tools/bench/posed_system.h"

#include <algorithm>
#include <fstream>
#include <stdexcept>

#include "pipeline/frame_solver.h"
#include "pipeline/mesh.h"
#include "pipeline/rotation_field.h"

namespace sinew {
namespace {

/// Far below the tolerances that are compared, far above rounding.
constexpr double kExactResidual = 1e-10;

constexpr char kMagic[8] = {'s', 'i', 'n', 'e', 'w', 's', 'y', '1'};

Eigen::Matrix3d turn_of(const RotationField& field, int node) {
  return (field.scales[node] * field.rotations[node].toRotationMatrix()).cast<double>();
}

/// The rotations of the first pass, by node.
RotationField rotations_for(const Rig& rig, const Pose& pose, ThreadTeam& team) {
  PoseRotations rotations(rig.skeleton, rig.binding);
  rotations.read(pose);
  RotationField field;
  blend_rotations(rig.harmonics, rotations, team, field);
  return field;
}

/// Every node's position; those of the constrained nodes, which alone are used, are exact.
Field3 constrained_positions(const Rig& rig, const Pose& pose, ThreadTeam& team) {
  FrameOptions options;
  options.deform = Deform::paper;
  FrameSolver solver(rig, options, team);
  solver.solve(pose);
  Field3 positions(rig.volume.node_count(), 3);
  solver.read_positions(positions);
  return positions;
}

void fill_right_hand_side(const Rig& rig, const Pose& pose, ThreadTeam& team, PosedSystem& posed) {
  const RotationField field = rotations_for(rig, pose, team);
  const Field3 placed = constrained_positions(rig, pose, team);
  const Graph& graph = rig.volume.graph;
  const Field3& rest = rig.volume.rest_positions;
  const Eigen::RowVector3d origin = pose.positions.front().transpose();
  posed.b.setZero(posed.size(), 3);
  posed.beta.setZero(posed.size(), 3);
  for (int free = 0; free < posed.size(); ++free) {
    const int node = rig.node_of_free[free];
    const Eigen::Matrix3d own = turn_of(field, node);
    posed.turns.push_back(own.cast<float>());
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
      const int other = graph.neighbors[k];
      const Eigen::Vector3d edge = (rest.row(node) - rest.row(other)).transpose();
      const Eigen::RowVector3d wanted = (0.5 * (own + turn_of(field, other)) * edge).transpose();
      if (rig.free_of_node[other] >= 0) {
        posed.b.row(free) += graph.weights[k] * wanted;
      } else {
        posed.beta.row(free) += graph.weights[k] * (placed.row(other) - origin + wanted);
      }
    }
  }
  posed.b += posed.beta;
}

template <typename T>
void put(std::ofstream& out, const T* values, std::size_t count) {
  out.write(reinterpret_cast<const char*>(values), static_cast<std::streamsize>(count * sizeof(T)));
}

template <typename T>
void take(std::ifstream& in, T* values, std::size_t count) {
  in.read(reinterpret_cast<char*>(values), static_cast<std::streamsize>(count * sizeof(T)));
}

template <typename Matrix>
void put_matrix(std::ofstream& out, const Matrix& matrix) {
  put(out, matrix.data(), static_cast<std::size_t>(matrix.size()));
}

template <typename Matrix>
void take_matrix(std::ifstream& in, Eigen::Index rows, Matrix& matrix) {
  matrix.resize(rows, matrix.ColsAtCompileTime == 1 ? 1 : 3);
  take(in, matrix.data(), static_cast<std::size_t>(matrix.size()));
}

}  // namespace

PosedSystem pose_system(const Rig& rig, const Pose& pose, const std::string& name, ThreadTeam& team) {
  PosedSystem posed;
  posed.name = name;
  posed.system = rig.system;
  posed.diagonal = bounds(rig.mesh).diagonal();
  fill_right_hand_side(rig, pose, team, posed);
  posed.exact.setZero(posed.size(), 3);
  const auto workspace = rig.solver->make_workspace(3);
  const SolveReport report = rig.solver->solve(
      posed.b, posed.exact, {.tolerance = kExactResidual, .max_cycles = 200, .from_zero = true}, *workspace);
  if (!report.converged) throw std::runtime_error(name + ": the reference solve did not converge");
  return posed;
}

EdgeTargets edge_targets(const PosedSystem& posed) {
  const Graph& graph = posed.system.graph;
  EdgeTargets targets;
  targets.beta = posed.beta;
  targets.wanted.resize(static_cast<Eigen::Index>(graph.neighbors.size()), 3);
  for (int i = 0; i < posed.size(); ++i) {
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
      const int j = graph.neighbors[k];
      const Eigen::Vector3d edge =
          (posed.system.rest_positions.row(i) - posed.system.rest_positions.row(j)).transpose();
      targets.wanted.row(k) =
          (0.5 * (posed.turns[i].cast<double>() + posed.turns[j].cast<double>()) * edge).transpose();
    }
  }
  return targets;
}

void write_posed_system(const std::filesystem::path& file, const PosedSystem& posed) {
  std::ofstream out(file, std::ios::binary);
  const Graph& graph = posed.system.graph;
  const std::uint64_t sizes[3] = {static_cast<std::uint64_t>(posed.size()), graph.neighbors.size(),
                                  posed.name.size()};
  put(out, kMagic, sizeof kMagic);
  put(out, sizes, 3);
  put(out, posed.name.data(), posed.name.size());
  put(out, &posed.diagonal, 1);
  put(out, graph.offsets.data(), graph.offsets.size());
  put(out, graph.neighbors.data(), graph.neighbors.size());
  put(out, graph.weights.data(), graph.weights.size());
  put_matrix(out, posed.system.anchor);
  put_matrix(out, posed.system.rest_positions);
  put_matrix(out, posed.b);
  put_matrix(out, posed.exact);
  put_matrix(out, posed.beta);
  put(out, posed.turns.data(), posed.turns.size());
  out.close();
  if (!out) throw std::runtime_error(file.string() + ": cannot be written");
}

PosedSystem read_posed_system(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  char magic[sizeof kMagic] = {};
  std::uint64_t sizes[3] = {};
  take(in, magic, sizeof magic);
  take(in, sizes, 3);
  if (!in || !std::equal(magic, magic + sizeof magic, kMagic))
    throw std::runtime_error(file.string() + ": is not a system");
  PosedSystem posed;
  Graph& graph = posed.system.graph;
  const auto n = static_cast<Eigen::Index>(sizes[0]);
  posed.name.resize(sizes[2]);
  graph.offsets.resize(sizes[0] + 1);
  graph.neighbors.resize(sizes[1]);
  graph.weights.resize(sizes[1]);
  posed.turns.resize(sizes[0]);
  take(in, posed.name.data(), posed.name.size());
  take(in, &posed.diagonal, 1);
  take(in, graph.offsets.data(), graph.offsets.size());
  take(in, graph.neighbors.data(), graph.neighbors.size());
  take(in, graph.weights.data(), graph.weights.size());
  take_matrix(in, n, posed.system.anchor);
  take_matrix(in, n, posed.system.rest_positions);
  take_matrix(in, n, posed.b);
  take_matrix(in, n, posed.exact);
  take_matrix(in, n, posed.beta);
  take(in, posed.turns.data(), posed.turns.size());
  if (!in) throw std::runtime_error(file.string() + ": ends too early");
  return posed;
}

double vertex_error(const PosedSystem& posed, const Columns& x) {
  return (x - posed.exact).rowwise().norm().maxCoeff() / posed.diagonal;
}

}  // namespace sinew
