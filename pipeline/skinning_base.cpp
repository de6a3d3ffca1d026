#include "pipeline/skinning_base.h"

#include <algorithm>

#include "solver/wide.h"

namespace sinew {

SkinningBase::SkinningBase(const Rig& rig, const FrameNodes& nodes)
    : rig_(rig), diagonal_(nodes.diagonal), center_(Eigen::Vector3d::Zero()) {
  const PoseRotations rotations(rig.skeleton, rig.binding);
  for (const BoneTurn& turn : rotations.turns()) {
    first_matrix_.push_back(matrix_count_);
    matrix_count_ += turn.twists ? static_cast<int>(kTwistKnots.size()) : 1;
  }
  if (nodes.slot_count == 0) return;
  const Eigen::Vector3d rest = rig.volume.rest_positions.row(nodes.node_of_slot[0]).transpose();
  center_ = rest - nodes.diagonal * nodes.records[0].rest.head<3>().cast<double>();
}

void SkinningBase::evaluate(const SlotBlends& blends, int batch, int count, const Eigen::Vector4f* rests,
                            const Eigen::VectorXf& coordinates, Eigen::Vector4f* positions) const {
  using Lanes = SlotBlends::Lanes;
  using Vector4 = Wide<float, 4>;
  Lanes sum[kPerMatrix] = {};
  const auto add = [&](int matrix, const Lanes& weights) {
    const float* const numbers = coordinates.data() + kPerMatrix * matrix;
    for (int k = 0; k < kPerMatrix; ++k) sum[k] += numbers[k] * weights;
  };
  blends.for_each_turn(
      batch, [&](int turn, const Lanes& weights) { add(first_matrix_[turn], weights); },
      [&](int turn, const Lanes& weights, const Lanes& along) {
        const auto shares = twist_parabolas(along);
        for (std::size_t knot = 0; knot < shares.size(); ++knot)
          add(first_matrix_[turn] + static_cast<int>(knot), shares[knot] * weights);
      });
  alignas(64) float matrices[kPerMatrix][kFitLanes];
  for (int k = 0; k < kPerMatrix; ++k) store(sum[k], matrices[k]);
  for (int lane = 0; lane < count; lane += 4) {
    const int some = std::min(4, count - lane);
    Vector4 rest[4] = {}, moved[4] = {};
    for (int k = 0; k < some; ++k) rest[k] = loaded<Vector4>(rests[lane + k].data());
    transpose(rest[0], rest[1], rest[2], rest[3]);
    for (int axis = 0; axis < 3; ++axis) {
      const auto entry = [&](int column) { return loaded<Vector4>(&matrices[4 * axis + column][lane]); };
      moved[axis] = entry(0) * rest[0] + entry(1) * rest[1] + entry(2) * rest[2] + entry(3);
    }
    transpose(moved[0], moved[1], moved[2], moved[3]);
    for (int k = 0; k < some; ++k) store(moved[k], positions[lane + k].data());
  }
}

void SkinningBase::read(const Pose& pose, const PoseRotations& rotations,
                        Eigen::VectorXf& coordinates) const {
  for (std::size_t index = 0; index < rotations.turns().size(); ++index) {
    const BoneTurn& turn = rotations.turns()[index];
    const double scale = pose.scales[turn.joint];
    const Eigen::Vector3d arm = (center_ - rig_.skeleton.joints[turn.joint].position) / diagonal_;
    const Eigen::Vector3d joint = (pose.positions[turn.joint] - pose.positions.front()) / diagonal_;
    for (std::size_t knot = 0; knot < (turn.twists ? kTwistKnots.size() : 1); ++knot) {
      const Eigen::Matrix3d matrix = scale * rotations.matrix_at(static_cast<int>(index), kTwistKnots[knot]);
      Eigen::Map<Eigen::Matrix<float, 3, 4, Eigen::RowMajor>> numbers(
          coordinates.data() + kPerMatrix * (first_matrix_[index] + knot));
      numbers.leftCols<3>() = matrix.cast<float>();
      numbers.col(3) = (joint + matrix * arm).cast<float>();
    }
  }
}

}  // namespace sinew
