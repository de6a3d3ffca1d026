#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>

#include <gtest/gtest.h>

#include "io/bvh.h"
#include "skeleton/retarget.h"
#include "skeleton/similarity.h"
#include "skeleton/unusable_input.h"
#include "tests/skeleton/humanoid.h"

namespace sinew {
namespace {

using Eigen::Vector3d;

/// One human clip of the shared data and what must be read from it.
struct HumanClip {
  std::string file;
  std::string joints;  ///< names of the joints in Role order, '-' where the clip has none
  Vector3d up;
};

const Vector3d kY = Vector3d::UnitY(), kZ = Vector3d::UnitZ();

const HumanClip kHumans[] = {
    {"bandai-namco/dataset-1_kick_normal_001.bvh",
     "Hips Spine Chest - Neck Head Shoulder_L UpperArm_L LowerArm_L Hand_L Shoulder_R UpperArm_R LowerArm_R "
     "Hand_R "
     "UpperLeg_L LowerLeg_L Foot_L Toes_L UpperLeg_R LowerLeg_R Foot_R Toes_R",
     kY},
    {"cgclub-motionbuilder/Boxing_Toes.bvh",
     "Hips Ab Chest - Neck Head LeftCollar LeftShoulder LeftElbow LeftWrist RightCollar RightShoulder "
     "RightElbow RightWrist "
     "LeftHip LeftKnee LeftAnkle LeftToes RightHip RightKnee RightAnkle RightToes",
     kY},
    {"cmu-cgspeed/01_01.bvh",
     "Hips LowerBack Spine Spine1 Neck Head LeftShoulder LeftArm LeftForeArm LeftHand RightShoulder RightArm "
     "RightForeArm "
     "RightHand LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase",
     kY},
    {"cmu-cgspeed/cmu_12_01_walk.bvh",
     "Hips LowerBack Spine Spine1 Neck Head LeftShoulder LeftArm LeftForeArm LeftHand RightShoulder RightArm "
     "RightForeArm "
     "RightHand LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase",
     kY},
    {"cmu-daz/jumping_jacks.bvh",
     "Hips lowerback Chest Chest2 lowerneck Head LeftCollar LeftShoulder LeftElbow LeftWrist RightCollar "
     "RightShoulder "
     "RightElbow RightWrist LeftHip LeftKnee LeftAnkle LeftToe RightHip RightKnee RightAnkle RightToe",
     kY},
    {"fair/jumping.bvh",
     "Hips Spine Spine2 Spine3 Neck Head LeftShoulder LeftArm LeftForeArm LeftHand RightShoulder RightArm "
     "RightForeArm "
     "RightHand LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase",
     kZ},
    {"freebvh-mixamo/test_freebvh.bvh",
     "mixamorig:Hips mixamorig:Spine mixamorig:Spine1 mixamorig:Spine2 mixamorig:Neck mixamorig:Head "
     "mixamorig:LeftShoulder mixamorig:LeftArm mixamorig:LeftForeArm mixamorig:LeftHand "
     "mixamorig:RightShoulder mixamorig:RightArm mixamorig:RightForeArm mixamorig:RightHand "
     "mixamorig:LeftUpLeg mixamorig:LeftLeg mixamorig:LeftFoot mixamorig:LeftToeBase "
     "mixamorig:RightUpLeg mixamorig:RightLeg mixamorig:RightFoot mixamorig:RightToeBase",
     kY},
    {"loth-daz/combo.bvh",
     "hip abdomen chest - neck head lCollar lShldr lForeArm lHand rCollar rShldr rForeArm rHand "
     "lThigh lShin lFoot lToes rThigh rShin rFoot rToes",
     kY},
    {"makehuman/walk1.bvh",
     "Root Spine1 Spine2 Spine3 Neck Head Clavicle_L UpArm_L LoArm_L Hand_L Clavicle_R UpArm_R LoArm_R "
     "Hand_R "
     "UpLeg_L LoLeg_L Foot_L Toe_L UpLeg_R LoLeg_R Foot_R Toe_R",
     kZ},
    {"mocapbank/test_mocapbank.bvh",
     "Hips Chest Chest2 - Neck Head LeftCollar LeftShoulder LeftElbow LeftWrist RightCollar RightShoulder "
     "RightElbow RightWrist "
     "LeftHip LeftKnee LeftAnkle - RightHip RightKnee RightAnkle -",
     kY},
    {"pymo/AV_8Walk_Meredith_HVHA_Rep1.bvh",
     "Hips Spine - - - Head LeftShoulder LeftArm LeftForeArm LeftHand RightShoulder RightArm RightForeArm "
     "RightHand "
     "LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase",
     kY},
    {"rokoko/jesse_dance.bvh",
     "Hips Spine Spine1 Spine2 Neck Head LeftShoulder LeftArm LeftForeArm LeftHand RightShoulder RightArm "
     "RightForeArm "
     "RightHand LeftUpLeg LeftLeg LeftFoot LeftToeBase RightUpLeg RightLeg RightFoot RightToeBase",
     kY}};

std::filesystem::path shared(const std::string& file) {
  return std::filesystem::path(SINEW_SHARED_DATA) / "bvh" / file;
}

double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

/// A clip, its joints by role, and the motion it gives the made-up human.
struct Retargeted {
  Clip clip;
  std::vector<int> joint_of_role;
  Motion motion;
  Motion parallel;  ///< without the outward swing of limbs
  int dropped = 0;  ///< frames of the clip that the motion leaves out at the start

  Vector3d bone(const Pose& pose, Role from, Role to) const {
    return pose.positions[static_cast<int>(to)] - pose.positions[static_cast<int>(from)];
  }
  int clip_joint(Role role) const { return joint_of_role[static_cast<int>(role)]; }
};

/// Read and retargeted once: several tests ask for each.
const Retargeted& retargeted(const std::string& file) {
  static std::map<std::string, Retargeted> known;
  if (const auto found = known.find(file); found != known.end()) return found->second;
  Retargeted made;
  made.clip = read_bvh(shared(file));
  made.joint_of_role = recognise_roles(made.clip.skeleton).joint_of_role;
  made.motion = retarget(made.clip, test::humanoid_rig());
  made.parallel = retarget(made.clip, test::humanoid_rig(), {.limb_swings = false});
  made.dropped = made.clip.frame_count - made.motion.frame_count();
  return known.emplace(file, std::move(made)).first->second;
}

class HumanClips : public testing::TestWithParam<HumanClip> {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(shared(GetParam().file))) GTEST_SKIP() << "no " << shared(GetParam().file);
  }
};

const std::pair<Role, Role> kLimbs[] = {
    {Role::left_upper_arm, Role::left_lower_arm},   {Role::left_lower_arm, Role::left_hand},
    {Role::right_upper_arm, Role::right_lower_arm}, {Role::right_lower_arm, Role::right_hand},
    {Role::left_upper_leg, Role::left_lower_leg},   {Role::left_lower_leg, Role::left_foot},
    {Role::right_upper_leg, Role::right_lower_leg}, {Role::right_lower_leg, Role::right_foot}};

TEST_P(HumanClips, play_every_role_they_have_a_joint_for) {
  const Clip clip = read_bvh(shared(GetParam().file));
  const RoleMap map = recognise_roles(clip.skeleton);
  std::string joints;
  for (const int joint : map.joint_of_role)
    joints += (joints.empty() ? "" : " ") + (joint < 0 ? "-" : clip.skeleton.names[joint]);
  EXPECT_EQ(joints, GetParam().joints);
}

TEST_P(HumanClips, point_the_limbs_of_another_body_exactly_where_their_own_point) {
  const Retargeted& made = retargeted(GetParam().file);
  // One rotation, the same for all bones and frames, must take the clip's directions to the motion's.
  std::vector<Vector3d> from, to;
  const int stride = std::max(1, made.motion.frame_count() / 500);
  for (int frame = 0; frame < made.motion.frame_count(); frame += stride) {
    const Pose source = pose_at(made.clip, frame + made.dropped);
    for (const auto& [upper, lower] : kLimbs) {
      from.push_back(
          (source.positions[made.clip_joint(lower)] - source.positions[made.clip_joint(upper)]).normalized());
      to.push_back(made.bone(made.parallel.poses[frame], upper, lower).normalized());
    }
  }
  const auto fit = fit_similarity(from, to);
  ASSERT_TRUE(fit);
  double worst = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i)
    worst = std::max(worst, degrees_between(fit->turn * from[i], to[i]));
  EXPECT_LE(worst, 0.01);
  EXPECT_LE(degrees_between(fit->turn * GetParam().up, kY), 1e-4);
}

TEST_P(HumanClips, swing_limbs_outward_by_five_degrees_at_most_and_never_at_a_jerk) {
  const Retargeted& made = retargeted(GetParam().file);
  Pose last;
  for (int frame = 0; frame < made.motion.frame_count(); ++frame) {
    Pose swings = made.motion.poses[frame];
    for (int joint = 0; joint < swings.joint_count(); ++joint) {
      swings.rotations[joint] =
          swings.rotations[joint] * made.parallel.poses[frame].rotations[joint].conjugate();
      const double swing = swings.rotations[joint].angularDistance(Eigen::Quaterniond::Identity());
      ASSERT_LE(swing, 5.01 * std::numbers::pi / 180.0) << "joint " << joint << " at frame " << frame;
      if (frame == 0) continue;
      ASSERT_LE(swings.rotations[joint].angularDistance(last.rotations[joint]), std::numbers::pi / 180.0)
          << "joint " << joint << " at frame " << frame;
    }
    last = swings;
  }
}

TEST_P(HumanClips, keep_the_head_above_the_hips) {
  const Retargeted& made = retargeted(GetParam().file);
  const auto upright =
      std::count_if(made.motion.poses.begin(), made.motion.poses.end(),
                    [&](const Pose& pose) { return made.bone(pose, Role::hips, Role::head).y() > 0.0; });
  EXPECT_GE(static_cast<double>(upright), 0.95 * made.motion.frame_count());
}

TEST_P(HumanClips, keep_left_on_the_left_as_the_toes_see_it) {
  const Retargeted& made = retargeted(GetParam().file);
  int left = 0;
  for (const Pose& pose : made.motion.poses) {
    const Vector3d ahead = made.bone(pose, Role::left_foot, Role::left_toes) +
                           made.bone(pose, Role::right_foot, Role::right_toes);
    left += made.bone(pose, Role::right_upper_leg, Role::left_upper_leg).dot(kY.cross(ahead)) > 0.0;
  }
  EXPECT_GE(left, 0.95 * made.motion.frame_count());
}

TEST_P(HumanClips, bend_knees_about_the_thighs_own_lateral_axis) {
  const Retargeted& made = retargeted(GetParam().file);
  for (const Role thigh : {Role::left_upper_leg, Role::right_upper_leg}) {
    const Role shin = static_cast<Role>(static_cast<int>(thigh) + 1),
               foot = static_cast<Role>(static_cast<int>(thigh) + 2);
    Vector3d hinge = Vector3d::Zero();
    for (const Pose& pose : made.motion.poses)
      hinge += pose.rotations[static_cast<int>(thigh)].conjugate() *
               made.bone(pose, thigh, shin).cross(made.bone(pose, shin, foot));
    // Backwards would be 180 degrees; what is left is the twist of the thigh, at most a seventh of that.
    EXPECT_LE(degrees_between(hinge, Vector3d::UnitX()), 28.0) << role_name(thigh);
  }
}

TEST_P(HumanClips, turn_no_joint_faster_than_the_clip_does) {
  const Retargeted& made = retargeted(GetParam().file);
  const RigSkeleton rig = test::humanoid_rig();
  const bool shared_out = made.clip_joint(Role::upper_chest) < 0;  // its spine is shorter than the rig's
  for (int joint = 1; joint < rig.joint_count(); ++joint) {
    const int parent = rig.joints[joint].parent;
    // A neck follows the last of the clip's neck joints, a head is turned against it.
    const auto source_of = [&](int role) {
      const int head = made.clip_joint(Role::head);
      const bool neck = role == static_cast<int>(Role::neck) && made.clip_joint(Role::neck) >= 0;
      return neck ? made.clip.skeleton.parents[head] : made.joint_of_role[role];
    };
    const int source = source_of(joint), source_parent = source_of(parent);
    const bool is_spine = joint <= static_cast<int>(Role::upper_chest);
    if (source < 0 || source_parent < 0 || (shared_out && is_spine)) continue;
    double fastest = 0.0, fastest_source = 0.0;
    Pose before = pose_at(made.clip, made.dropped);
    for (int frame = 1; frame < made.parallel.frame_count(); ++frame) {
      const Pose& last = made.parallel.poses[frame - 1];
      const Pose& pose = made.parallel.poses[frame];
      const Pose now = pose_at(made.clip, frame + made.dropped);
      const Eigen::Quaterniond relative = pose.rotations[parent].conjugate() * pose.rotations[joint];
      const Eigen::Quaterniond relative_last = last.rotations[parent].conjugate() * last.rotations[joint];
      EXPECT_GE(relative.dot(relative_last), 0.0) << rig.joints[joint].name << " at frame " << frame;
      fastest = std::max(fastest, relative.angularDistance(relative_last));
      fastest_source = std::max(
          fastest_source,
          (now.rotations[source_parent].conjugate() * now.rotations[source])
              .angularDistance(before.rotations[source_parent].conjugate() * before.rotations[source]));
      before = now;
    }
    EXPECT_LE(fastest, fastest_source + 1e-6) << rig.joints[joint].name;
  }
}

TEST_P(HumanClips, stand_on_the_rigs_floor_with_level_soles) {
  const Retargeted& made = retargeted(GetParam().file);
  std::vector<double> lowest;
  std::vector<std::pair<double, double>> height_and_tilt;
  for (const Pose& pose : made.motion.poses) {
    for (const int foot : {static_cast<int>(Role::left_foot), static_cast<int>(Role::right_foot)})
      height_and_tilt.emplace_back(pose.positions[foot].y(), degrees_between(pose.rotations[foot] * kY, kY));
    lowest.push_back(
        std::min(height_and_tilt.back().first, height_and_tilt[height_and_tilt.size() - 2].first));
  }
  // The rig's ankles rest at 8 cm. One clip sits down, which other proportions do a hand's breadth lower.
  std::sort(lowest.begin(), lowest.end());
  EXPECT_NEAR(lowest[lowest.size() / 20], 0.08, 0.05);
  std::sort(height_and_tilt.begin(), height_and_tilt.end());
  double tilt = 0.0;
  const std::size_t low = std::max<std::size_t>(1, height_and_tilt.size() / 5);
  for (std::size_t i = 0; i < low; ++i) tilt += height_and_tilt[i].second / static_cast<double>(low);
  // The boxer dances on his toes; the others stand.
  EXPECT_LE(tilt, GetParam().file.find("Toes") == std::string::npos ? 10.0 : 25.0);
}

std::string label_of(const testing::TestParamInfo<HumanClip>& clip) {
  std::string label = clip.param.file;
  std::replace_if(
      label.begin(), label.end(), [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; },
      '_');
  return label;
}

INSTANTIATE_TEST_SUITE_P(Shared, HumanClips, testing::ValuesIn(kHumans), label_of);

TEST(RetargetData, a_walk_goes_where_the_body_looks_and_its_knees_bend_forwards) {
  for (const char* file : {"cmu-cgspeed/cmu_12_01_walk.bvh", "pymo/AV_8Walk_Meredith_HVHA_Rep1.bvh"}) {
    if (!std::filesystem::exists(shared(file))) GTEST_SKIP() << "no " << shared(file);
    SCOPED_TRACE(file);
    const Retargeted& made = retargeted(file);
    const int half_second = static_cast<int>(made.motion.frames_per_second / 2.0);
    for (int frame = 0; frame + half_second < made.motion.frame_count(); frame += half_second) {
      const Pose& pose = made.motion.poses[frame];
      const Vector3d ahead = pose.rotations[0] * kZ;
      const Vector3d way = made.motion.poses[frame + half_second].positions[0] - pose.positions[0];
      EXPECT_GT(way.normalized().dot(ahead), 0.8) << frame;
    }
    for (const Pose& pose : made.motion.poses)
      for (const Role thigh : {Role::left_upper_leg, Role::right_upper_leg}) {
        const Role shin = static_cast<Role>(static_cast<int>(thigh) + 1),
                   foot = static_cast<Role>(static_cast<int>(thigh) + 2);
        const Vector3d upper = made.bone(pose, thigh, shin), lower = made.bone(pose, shin, foot);
        const double forwards = (upper - lower).dot(pose.rotations[0] * kZ);
        EXPECT_TRUE(forwards > 0.0 || degrees_between(upper, lower) < 20.0) << role_name(shin);
      }
  }
}

TEST(RetargetData, reference_frames_put_before_the_motion_are_left_out_of_cmu_clips_alone) {
  for (const HumanClip& human : kHumans) {
    if (!std::filesystem::exists(shared(human.file))) GTEST_SKIP() << "no " << shared(human.file);
    const bool cmu = human.file.starts_with("cmu-cgspeed");
    EXPECT_EQ(retargeted(human.file).dropped, cmu ? 1 : 0) << human.file;
  }
}

TEST(RetargetData, clips_of_other_bodies_are_refused_by_name_of_what_they_lack) {
  const std::pair<const char*, const char*> refusals[] = {
      {"truebones/Crab-dance-long.bvh",
       "no joint of the clip plays spine, head, left_upper_arm, left_lower_arm, right_upper_arm, "
       "right_lower_arm, "
       "left_upper_leg, left_lower_leg, right_upper_leg, right_lower_leg; name them in the rig file's [map]"},
      {"pybvh/rotation_first_root.bvh",
       "no joint of the clip plays left_upper_arm, left_lower_arm, right_upper_arm, right_lower_arm, "
       "left_upper_leg, "
       "right_upper_leg, right_lower_leg; name them in the rig file's [map]"}};
  for (const auto& [file, message] : refusals) {
    if (!std::filesystem::exists(shared(file))) GTEST_SKIP() << "no " << shared(file);
    try {
      retarget(read_bvh(shared(file)), test::humanoid_rig());
      FAIL() << file << " was accepted";
    } catch (const UnusableInput& refused) {
      EXPECT_STREQ(refused.what(), message);
    }
  }
}

TEST(RetargetData, a_crab_dances_on_its_own_skeleton) {
  if (!std::filesystem::exists(shared("truebones/Crab-dance-long.bvh"))) GTEST_SKIP() << "no shared clips";
  const Clip clip = read_bvh(shared("truebones/Crab-dance-long.bvh"));
  const Pose declared = forward_kinematics(clip.skeleton, clip.skeleton.rest);
  RigSkeleton rig;
  for (int joint = 0; joint < clip.skeleton.joint_count(); ++joint) {
    RigJoint made;
    made.name = clip.skeleton.names[joint];
    made.parent = clip.skeleton.parents[joint];
    made.position = declared.positions[joint];
    rig.joints.push_back(made);
  }
  const Motion motion = retarget(clip, rig);
  ASSERT_EQ(motion.frame_count(), clip.frame_count);
  for (int frame = 0; frame < clip.frame_count; frame += 50) {
    const Pose source = pose_at(clip, frame);
    for (int joint = 0; joint < rig.joint_count(); ++joint)
      EXPECT_LE((motion.poses[frame].positions[joint] - source.positions[joint]).norm(), 1e-9);
  }
}

}  // namespace
}  // namespace sinew
