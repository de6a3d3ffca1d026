#include "pipeline/slot_blends.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "arm_rig.h"
#include "pipeline/skinning.h"
#include "pipeline/skinning_base.h"

namespace sinew {
namespace {

class SlotBlendsForms : public testing::TestWithParam<Deform> {
 protected:
  ThreadTeam team_{1};
  const Rig rig_ = build_rig(arm_mesh(), arm_skeleton(), arm_options(GetParam()), team_);
  const FrameNodes nodes_{rig_};
  PoseRotations rotations_{rig_.skeleton, rig_.binding};

  SlotBlends blends(int count) const {
    return {rig_.harmonics, {nodes_.node_of_slot.data(), static_cast<std::size_t>(count)}, rotations_};
  }
  Eigen::Quaternionf blended_alone(int node) const {
    const int begin = rig_.harmonics.offsets[node], end = rig_.harmonics.offsets[node + 1];
    std::vector<BlendTerm> terms;
    rotations_.append_terms(&rig_.harmonics.fields[begin], &rig_.harmonics.weights[begin], end - begin,
                            terms);
    return rotations_.blend(terms);
  }
};

TEST_P(SlotBlendsForms, batches_are_blended_as_their_nodes_are) {
  const int count = nodes_.slot_count / kFitLanes * kFitLanes - 1;  // the last batch is not full
  const SlotBlends all = blends(count);
  for (const double twist : {0.0, 80.0, 300.0, -170.0}) {
    rotations_.read(bent_arm(70, twist));
    FitBatch batch;
    for (int slot = 0; slot < count; ++slot) {
      const int lane = slot % kFitLanes;
      if (lane == 0) all.blend(slot / kFitLanes, rotations_, batch.rotation);
      Eigen::Vector4f found;
      for (int k = 0; k < 4; ++k) found[k] = batch.rotation[k][lane];
      const Eigen::Vector4f wanted = blended_alone(nodes_.node_of_slot[slot]).coeffs();
      EXPECT_LT((found.normalized() - wanted).norm(), 1e-5f) << twist;
    }
    for (int k = 0; k < 4; ++k) EXPECT_EQ(batch.rotation[k][kFitLanes - 1], k < 3 ? 0.0f : 1.0f);
  }
}

TEST_P(SlotBlendsForms, skinning_is_that_of_the_harmonic_weights) {
  const SkinningBase skinning(rig_, nodes_);
  const SlotBlends all = blends(nodes_.slot_count);
  const Pose pose = bent_arm(100);
  rotations_.read(pose);
  Eigen::VectorXf coordinates(skinning.coordinate_count());
  skinning.read(pose, rotations_, coordinates);
  Field3 wanted(rig_.volume.node_count(), 3);
  linear_blend_skinning(rig_, pose, wanted);
  for (int first = 0; first < nodes_.slot_count; first += kFitLanes) {
    const int count = std::min(kFitLanes, nodes_.slot_count - first);
    std::array<Eigen::Vector4f, kFitLanes> rests;
    std::array<Eigen::Vector4f, kFitLanes> found;
    for (int lane = 0; lane < count; ++lane) rests[lane] = nodes_.records[first + lane].rest;
    skinning.evaluate(all, first / kFitLanes, count, rests.data(), coordinates, found.data());
    for (int lane = 0; lane < count; ++lane) {
      const Eigen::Vector3d position =
          nodes_.diagonal * found[lane].head<3>().cast<double>() + pose.positions.front();
      EXPECT_LT((position - wanted.row(nodes_.node_of_slot[first + lane]).transpose()).norm(),
                1e-6 * nodes_.diagonal);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(BothForms, SlotBlendsForms, testing::Values(Deform::refined, Deform::paper),
                         [](const auto& form) {
                           return form.param == Deform::refined ? "refined" : "paper";
                         });

TEST(SlotBlends, twists_of_nearly_two_turns_are_followed_to_their_ends) {
  ThreadTeam team(1);
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), arm_options(Deform::refined), team);
  const auto& sources = rig.binding.fields;
  const auto far_end = std::find_if(sources.begin(), sources.end(), [&](const FieldSource& source) {
    return source.far_end && rig.binding.bones[source.bone].twisted_by >= 0;
  });
  ASSERT_NE(far_end, sources.end());
  const int far = static_cast<int>(far_end - sources.begin());
  const Eigen::Quaterniond none = Eigen::Quaterniond::Identity(), most = turn(355, {1, 0, 0});
  PoseRotations rotations(rig.skeleton, rig.binding);
  rotations.read(posed(rig.skeleton, {none, most, most}));
  HarmonicFields fields;
  std::vector<int> nodes;
  fields.offsets = {0};
  for (int node = 0; node < kFitLanes; ++node) {
    const float along = static_cast<float>(node) / (kFitLanes - 1);
    fields.fields.insert(fields.fields.end(), {far - 1, far});
    fields.weights.insert(fields.weights.end(), {1.0f - along, along});
    fields.offsets.push_back(2 * node + 2);
    nodes.push_back(node);
  }
  FitBatch batch;
  SlotBlends(fields, nodes, rotations).blend(0, rotations, batch.rotation);
  for (int node = 0; node < kFitLanes; ++node) {
    const Eigen::Quaterniond wanted = turn(710.0 * node / (kFitLanes - 1), {1, 0, 0});
    for (int k = 0; k < 4; ++k) EXPECT_NEAR(batch.rotation[k][node], wanted.coeffs()[k], 1e-5) << node;
  }
}

TEST(SlotBlends, where_opposite_bones_cancel_the_strongest_decides) {
  ThreadTeam team(1);
  const Rig rig = build_rig(arm_mesh(), arm_skeleton(), arm_options(Deform::paper), team);
  const Eigen::Quaterniond one = turn(100, {1, 2, -1});
  Pose pose = rest_pose(rig.skeleton);
  pose.rotations[rig.binding.bones[0].joint] = one;
  pose.rotations[rig.binding.bones[1].joint] = Eigen::Quaterniond(-one.coeffs());
  PoseRotations rotations(rig.skeleton, rig.binding);
  rotations.read(pose);
  HarmonicFields fields;
  fields.field_count = static_cast<int>(rig.binding.fields.size());
  fields.offsets = {0, 2, 4};
  fields.fields = {0, 1, 0, 1};
  fields.weights = {0.50001f, 0.49999f, 0.49999f, 0.50001f};
  const std::vector<int> nodes = {0, 1};
  FitBatch batch;
  SlotBlends(fields, nodes, rotations).blend(0, rotations, batch.rotation);
  for (int k = 0; k < 4; ++k) {
    EXPECT_FLOAT_EQ(batch.rotation[k][0], static_cast<float>(one.coeffs()[k]));
    EXPECT_FLOAT_EQ(batch.rotation[k][1], static_cast<float>(-one.coeffs()[k]));
  }
}

}  // namespace
}  // namespace sinew
