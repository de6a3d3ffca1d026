#include "io/morph_normals.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace sinew {
namespace {

constexpr Eigen::Index kFramesAtOnce = 16;

/// Keeps targets with nearly the same weights over time apart; as a share of the mean diagonal entry it
/// is far below what a float weight can tell.
constexpr double kRidge = 1e-10;

/// frame_count x target_count: row f says how frame f enters the targets of the least-squares fit.
Eigen::MatrixXf least_squares(const MorphClip& clip, Eigen::Index frame_count) {
  const Eigen::Index targets = clip.target_count();
  const Eigen::MatrixXd weights =
      Eigen::Map<const Eigen::MatrixXf>(clip.weights.data(), targets, frame_count).cast<double>();
  Eigen::MatrixXd squares = weights * weights.transpose();
  squares.diagonal().array() += kRidge * squares.trace() / static_cast<double>(targets);
  return squares.llt().solve(weights).transpose().cast<float>();
}

}  // namespace

std::vector<std::vector<float>> fit_morph_normals(const SurfaceNormals& normals, FrameSpan frames,
                                                  const RigidMotion& motion, const MorphClip& clip) {
  const Eigen::Index targets = clip.target_count();
  if (targets == 0) return {};
  const auto frame_count = static_cast<Eigen::Index>(frames.size());
  const Eigen::MatrixXf shares = least_squares(clip, frame_count);

  const Eigen::Index rows = 3 * normals.group_count();
  const Eigen::VectorXd rest = Eigen::Map<const Eigen::VectorXd>(normals.rest().data(), rows);
  Eigen::MatrixXf sums = Eigen::MatrixXf::Zero(rows, targets);
  Eigen::MatrixXf block(rows, kFramesAtOnce);
  std::vector<double> local(frames.front().size());
  Eigen::VectorXd now(rows);
  for (Eigen::Index first = 0; first < frame_count; first += kFramesAtOnce) {
    const Eigen::Index count = std::min(kFramesAtOnce, frame_count - first);
    for (Eigen::Index i = 0; i < count; ++i) {
      const auto frame = static_cast<std::size_t>(first + i);
      remove_rigid_motion(motion, static_cast<int>(frame), frames[frame], local);
      normals.deformed(local, {now.data(), static_cast<std::size_t>(rows)});
      block.col(i) = (now - rest).cast<float>();
    }
    sums.noalias() += block.leftCols(count) * shares.middleRows(first, count);
  }
  std::vector<std::vector<float>> result;
  for (Eigen::Index k = 0; k < targets; ++k)
    result.emplace_back(sums.col(k).data(), sums.col(k).data() + rows);
  return result;
}

}  // namespace sinew
