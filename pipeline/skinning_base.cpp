#include "pipeline/skinning_base.h"

#include "solver/wide.h"

namespace sinew {
namespace {

using Vector16 = Wide<float, 16>;

}  // namespace

SlotTerms::SlotTerms(const Rig& rig, const FrameNodes& nodes, const PoseRotations& rotations) {
  const HarmonicFields& fields = rig.harmonics;
  std::vector<BlendTerm> of_node;
  offsets.push_back(0);
  for (const int node : nodes.node_of_slot) {
    const int begin = fields.offsets[node];
    const int count = fields.offsets[node + 1] - begin;
    of_node.clear();
    rotations.append_terms(&fields.fields[begin], &fields.weights[begin], count, of_node);
    terms.insert(terms.end(), of_node.begin(), of_node.end());
    offsets.push_back(static_cast<int>(terms.size()));
  }
  terms.shrink_to_fit();
}

SlotTerms::SlotTerms(const SlotTerms& all, std::span<const int> slots) {
  offsets.push_back(0);
  for (const int slot : slots) {
    const std::span<const BlendTerm> some = all.of(slot);
    terms.insert(terms.end(), some.begin(), some.end());
    offsets.push_back(static_cast<int>(terms.size()));
  }
}

SkinningBase::SkinningBase(const Rig& rig, const FrameNodes& nodes)
    : rig_(rig), diagonal_(nodes.diagonal), center_(Eigen::Vector3d::Zero()) {
  const PoseRotations rotations(rig.skeleton, rig.binding);
  place_count_ = static_cast<int>(rotations.table().size());
  if (nodes.slot_count == 0) return;
  const Eigen::Vector3d rest = rig.volume.rest_positions.row(nodes.node_of_slot[0]).transpose();
  center_ = rest - nodes.diagonal * nodes.records[0].rest.head<3>().cast<double>();
}

// Two running sums of whole matrices, column by column; their last rows are zero.
Eigen::Vector4f SkinningBase::at(std::span<const BlendTerm> terms, const Eigen::Vector4f& rest,
                                 const Eigen::VectorXf& coordinates) {
  const float* const all = coordinates.data();
  Vector16 below{};
  Vector16 above{};
  for (const BlendTerm& term : terms) {
    const float* const matrix = all + kPerPlace * term.place;
    below += term.below * loaded<Vector16>(matrix);
    above += term.above * loaded<Vector16>(matrix + kPerPlace);
  }
  const Vector16 sum = below + above;
  const Wide<float, 4> moved =
      quarter<0>(sum) * rest[0] + quarter<1>(sum) * rest[1] + quarter<2>(sum) * rest[2] + quarter<3>(sum);
  Eigen::Vector4f position;
  store(moved, position.data());
  return position;
}

void SkinningBase::read(const Pose& pose, const PoseRotations& rotations,
                        Eigen::VectorXf& coordinates) const {
  for (const PlaceRange& range : rotations.ranges()) {
    const double scale = pose.scales[range.joint];
    const Eigen::Vector3d arm = (center_ - rig_.skeleton.joints[range.joint].position) / diagonal_;
    const Eigen::Vector3d joint = (pose.positions[range.joint] - pose.positions.front()) / diagonal_;
    for (int place = range.first; place < range.first + range.count; ++place) {
      const Eigen::Matrix3d turn = scale * rotations.matrix_at(place);
      Eigen::Map<Eigen::Matrix4f> matrix(coordinates.data() + kPerPlace * place);
      matrix.setZero();
      matrix.topLeftCorner<3, 3>() = turn.cast<float>();
      matrix.topRightCorner<3, 1>() = (joint + turn * arm).cast<float>();
    }
  }
}

}  // namespace sinew
