#include "pipeline/preview.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

namespace sinew {
namespace {

/// Blocks of the subspace per piece of parallel work.
constexpr int kBlocksAtOnce = 16;

const Subspace& surface_subspace(const Rig& rig) {
  if (!rig.subspace || rig.subspace->of() != SubspaceOf::surface) {
    throw std::invalid_argument("Preview: the rig has no subspace of its surface");
  }
  return *rig.subspace;
}

}  // namespace

Preview::Preview(const Rig& rig, ThreadTeam& team)
    : rig_(rig),
      subspace_(surface_subspace(rig)),
      team_(team),
      diagonal_(rest_diagonal(rig.volume)),
      rotations_(rig.skeleton, rig.binding),
      coordinates_(Eigen::VectorXf::Zero(subspace_.coordinate_count())) {}

void Preview::answer(const Pose& pose, Eigen::Ref<Field3> positions) {
  if (pose.joint_count() != rig_.skeleton.joint_count()) {
    throw std::invalid_argument("Preview::answer: got " + std::to_string(pose.joint_count()) +
                                " joints; the rig has " + std::to_string(rig_.skeleton.joint_count()));
  }
  if (positions.rows() != subspace_.row_count()) {
    throw std::invalid_argument("Preview::answer: got " + std::to_string(positions.rows()) +
                                " rows; the surface has " + std::to_string(subspace_.row_count()) +
                                " vertices");
  }
  rotations_.read(pose);
  subspace_.read(pose, rotations_, coordinates_);
  const Eigen::Vector3d origin = pose.positions.front();
  const int blocks = subspace_.block_count();
  team_.for_each_block((blocks + kBlocksAtOnce - 1) / kBlocksAtOnce, [&](int piece) {
    std::array<Eigen::Vector4f, Subspace::kBlock> rows;
    for (int block = piece * kBlocksAtOnce; block < std::min(blocks, (piece + 1) * kBlocksAtOnce); ++block) {
      subspace_.evaluate(block, coordinates_, rows.data());
      const int first = block * Subspace::kBlock;
      const int count = std::min(Subspace::kBlock, subspace_.row_count() - first);
      for (int row = 0; row < count; ++row) {
        const Eigen::Vector3d place = origin + diagonal_ * rows[row].head<3>().cast<double>();
        positions.row(subspace_.nodes()[first + row]) = place.transpose();
      }
    }
  });
}

PreviewError measure_preview(const Rig& rig, const Motion& motion, int first_frame, int last_frame, int count,
                             const FrameOptions& options, ThreadTeam& team) {
  PreviewError error;
  const int available = last_frame - first_frame + 1;
  const int measured = std::clamp(available, 0, count);
  Preview preview(rig, team);
  FrameSolver solver(rig, options, team);
  const int vertices = rig.volume.surface_count;
  Field3 shown(vertices, 3);
  Field3 solved(vertices, 3);
  double squares = 0.0;
  const double diagonal = rest_diagonal(rig.volume);
  for (int k = 0; k < measured; ++k) {
    // The middles of equal stretches.
    const int frame = first_frame + static_cast<int>((2LL * k + 1) * available / (2 * measured));
    error.frames.push_back(frame);
    solver.forget();
    solver.solve(motion.poses[frame]);
    solver.read_positions(solved);
    preview.answer(motion.poses[frame], shown);
    const Eigen::VectorXd distances = (shown - solved).rowwise().norm() / diagonal;
    squares += distances.squaredNorm();
    if (vertices == 0 || distances.maxCoeff() <= error.largest) continue;
    error.largest = distances.maxCoeff();
    error.worst_frame = frame;
  }
  if (measured > 0 && vertices > 0)
    error.rms = std::sqrt(squares / (static_cast<double>(measured) * vertices));
  return error;
}

}  // namespace sinew
