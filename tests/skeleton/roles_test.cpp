#include "skeleton/roles.h"

#include <algorithm>
#include <sstream>

#include <gtest/gtest.h>

namespace sinew {
namespace {

/// Names with their depths, depth first: "0:Hips 1:Spine 2:Head".
Skeleton skeleton_from(const std::string& tree) {
  Skeleton skeleton;
  std::istringstream words(tree);
  std::vector<int> path;
  for (std::string word; words >> word;) {
    const std::size_t depth = std::stoul(word.substr(0, word.find(':')));
    std::string name = word.substr(word.find(':') + 1);
    std::replace(name.begin(), name.end(), '~', ' ');  // stands for a blank within a name
    path.resize(depth);
    skeleton.parents.push_back(path.empty() ? -1 : path.back());
    path.push_back(static_cast<int>(skeleton.names.size()));
    skeleton.names.push_back(name);
  }
  skeleton.rest.resize(skeleton.names.size());
  skeleton.tips.resize(skeleton.names.size());
  return skeleton;
}

/// A whole body in some scheme: chains of words from the body outwards, '%' for the mark of the side.
struct Naming {
  std::string label, hips, spine, neck, head, arm, leg;
  std::string left, right;
};

void append(std::string& tree, int depth, const std::string& name) {
  tree += std::to_string(depth) + ":" + name + " ";
}

void append_chain(std::string& tree, int depth, const std::string& words, const std::string& side) {
  std::istringstream stream(words);
  for (std::string word; stream >> word; ++depth) {
    if (const std::size_t at = word.find('%'); at != std::string::npos) word.replace(at, 1, side);
    append(tree, depth, word);
  }
}

Skeleton body_in(const Naming& naming) {
  std::string tree;
  append(tree, 0, naming.hips);
  for (const std::string& side : {naming.left, naming.right}) append_chain(tree, 1, naming.leg, side);
  append_chain(tree, 1, naming.spine, "");
  const int top = 1 + static_cast<int>(std::count(naming.spine.begin(), naming.spine.end(), ' ') + 1);
  append(tree, top, naming.neck);
  append(tree, top + 1, naming.head);
  for (const std::string& side : {naming.left, naming.right}) append_chain(tree, top, naming.arm, side);
  return skeleton_from(tree);
}

/// The name of the joint that plays `role`, '~' for its blanks; "" where none does.
std::string name_of(const Skeleton& skeleton, const RoleMap& map, Role role) {
  const int joint = map.joint_of_role[static_cast<int>(role)];
  std::string name = joint < 0 ? "" : skeleton.names[joint];
  std::replace(name.begin(), name.end(), ' ', '~');
  return name;
}

class WholeBody : public testing::TestWithParam<Naming> {};

TEST_P(WholeBody, plays_every_role_with_the_joint_on_the_right_place) {
  const Naming& naming = GetParam();
  const Skeleton skeleton = body_in(naming);
  const RoleMap map = recognise_roles(skeleton);
  SCOPED_TRACE(map.scheme);
  const auto side = [](std::string word, const std::string& mark) {
    return word.replace(word.find('%'), 1, mark);
  };
  const std::pair<Role, std::string> limbs[] = {{Role::left_shoulder, naming.left},
                                                {Role::right_shoulder, naming.right}};
  EXPECT_EQ(name_of(skeleton, map, Role::hips), naming.hips);
  EXPECT_EQ(name_of(skeleton, map, Role::neck), naming.neck);
  EXPECT_EQ(name_of(skeleton, map, Role::head), naming.head);
  for (const auto& [first, mark] : limbs) {
    std::istringstream arm(naming.arm), leg(naming.leg);
    const int leg_offset = static_cast<int>(Role::left_upper_leg) - static_cast<int>(Role::left_shoulder);
    for (int part = 0; part < 4; ++part) {
      std::string word;
      arm >> word;
      EXPECT_EQ(name_of(skeleton, map, static_cast<Role>(static_cast<int>(first) + part)), side(word, mark));
      leg >> word;
      EXPECT_EQ(name_of(skeleton, map, static_cast<Role>(static_cast<int>(first) + leg_offset + part)),
                side(word, mark));
    }
  }
  std::istringstream spine(naming.spine);
  std::string lowest;
  spine >> lowest;
  EXPECT_EQ(name_of(skeleton, map, Role::spine), lowest);
}

const Naming kNamings[] = {
    {"Mixamo", "mixamorig:Hips", "mixamorig:Spine mixamorig:Spine1 mixamorig:Spine2", "mixamorig:Neck",
     "mixamorig:Head", "mixamorig:%Shoulder mixamorig:%Arm mixamorig:%ForeArm mixamorig:%Hand",
     "mixamorig:%UpLeg mixamorig:%Leg mixamorig:%Foot mixamorig:%ToeBase", "Left", "Right"},
    {"MixamoNumbered", "mixamorig4:Hips", "mixamorig4:Spine mixamorig4:Spine1", "mixamorig4:Neck",
     "mixamorig4:Head", "mixamorig4:%Shoulder mixamorig4:%Arm mixamorig4:%ForeArm mixamorig4:%Hand",
     "mixamorig4:%UpLeg mixamorig4:%Leg mixamorig4:%Foot mixamorig4:%ToeBase", "Left", "Right"},
    {"MixamoGlued", "mixamorigHips", "mixamorigSpine mixamorigSpine1", "mixamorigNeck", "mixamorigHead",
     "mixamorig%Shoulder mixamorig%Arm mixamorig%ForeArm mixamorig%Hand",
     "mixamorig%UpLeg mixamorig%Leg mixamorig%Foot mixamorig%ToeBase", "Left", "Right"},
    {"LaFAN1", "Hips", "Spine Spine1 Spine2", "Neck", "Head", "%Shoulder %Arm %ForeArm %Hand",
     "%UpLeg %Leg %Foot %Toe", "Left", "Right"},
    {"CmuMotionBuilder", "Hips", "LowerBack Spine Spine1", "Neck", "Head", "%Shoulder %Arm %ForeArm %Hand",
     "%UpLeg %Leg %Foot %ToeBase", "Left", "Right"},
    {"CmuMax", "Hips", "lowerback Chest Chest2", "lowerneck", "Head", "%Collar %Shoulder %Elbow %Wrist",
     "%Hip %Knee %Ankle %Toe", "Left", "Right"},
    {"Daz", "hip", "abdomen chest", "neck", "head", "%Collar %Shldr %ForeArm %Hand",
     "%Thigh %Shin %Foot %Toe", "l", "r"},
    {"DazGenesis8", "hip", "abdomenLower abdomenUpper chestLower", "neckLower", "head",
     "%Collar %ShldrBend %ForearmBend %Hand", "%ThighBend %Shin %Foot %Toe", "l", "r"},
    {"BandaiNamco", "Hips", "Spine Chest", "Neck", "Head", "Shoulder_% UpperArm_% LowerArm_% Hand_%",
     "UpperLeg_% LowerLeg_% Foot_% Toes_%", "L", "R"},
    {"Biped", "Bip01~Pelvis", "Bip01~Spine Bip01~Spine1", "Bip01~Neck", "Bip01~Head",
     "Bip01~%~Clavicle Bip01~%~UpperArm Bip01~%~Forearm Bip01~%~Hand",
     "Bip01~%~Thigh Bip01~%~Calf Bip01~%~Foot Bip01~%~Toe0", "L", "R"},
    {"Valve", "ValveBiped.Bip01_Pelvis",
     "ValveBiped.Bip01_Spine ValveBiped.Bip01_Spine1 ValveBiped.Bip01_Spine4", "ValveBiped.Bip01_Neck1",
     "ValveBiped.Bip01_Head1",
     "ValveBiped.Bip01_%_Clavicle ValveBiped.Bip01_%_UpperArm ValveBiped.Bip01_%_Forearm "
     "ValveBiped.Bip01_%_Hand",
     "ValveBiped.Bip01_%_Thigh ValveBiped.Bip01_%_Calf ValveBiped.Bip01_%_Foot ValveBiped.Bip01_%_Toe0", "L",
     "R"},
    {"Rokoko", "hip", "spine chest", "neck", "head", "%Shoulder %UpperArm %LowerArm %Hand",
     "%UpLeg %Leg %Foot %Toe", "left", "right"},
    {"Unreal", "pelvis", "spine_01 spine_02 spine_03", "neck_01", "head",
     "clavicle_% upperarm_% lowerarm_% hand_%", "thigh_% calf_% foot_% ball_%", "l", "r"},
    {"Unity", "Hips", "Spine Chest UpperChest", "Neck", "Head", "%Shoulder %UpperArm %LowerArm %Hand",
     "%UpperLeg %LowerLeg %Foot %Toes", "Left", "Right"},
    {"VRoid", "J_Bip_C_Hips", "J_Bip_C_Spine J_Bip_C_Chest J_Bip_C_UpperChest", "J_Bip_C_Neck",
     "J_Bip_C_Head", "J_Bip_%_Shoulder J_Bip_%_UpperArm J_Bip_%_LowerArm J_Bip_%_Hand",
     "J_Bip_%_UpperLeg J_Bip_%_LowerLeg J_Bip_%_Foot J_Bip_%_ToeBase", "L", "R"},
    {"MakeHuman", "root", "spine05 spine04 spine03 spine02 spine01", "neck01", "head",
     "clavicle.% upperarm01.% lowerarm01.% wrist.%", "upperleg01.% lowerleg01.% foot.% toe1-1.%", "L", "R"},
    {"Smpl", "pelvis", "spine1 spine2 spine3", "neck", "head", "%_collar %_shoulder %_elbow %_wrist",
     "%_hip %_knee %_ankle %_foot", "left", "right"},
    {"SmplShort", "Pelvis", "Spine1 Spine2 Spine3", "Neck", "Head", "%_Collar %_Shoulder %_Elbow %_Wrist",
     "%_Hip %_Knee %_Ankle %_Foot", "L", "R"},
    {"Soma", "Hips", "Spine1 Spine2 Chest", "Neck1", "Head", "%Shoulder %Arm %ForeArm %Hand",
     "%Leg %Shin %Foot %ToeBase", "Left", "Right"},
    {"Rigify", "DEF-spine", "DEF-spine.001 DEF-spine.002 DEF-spine.003", "DEF-spine.004", "DEF-spine.006",
     "DEF-shoulder.% DEF-upper_arm.% DEF-forearm.% DEF-hand.%", "DEF-thigh.% DEF-shin.% DEF-foot.% DEF-toe.%",
     "L", "R"},
    {"Reallusion", "CC_Base_Hip", "CC_Base_Waist CC_Base_Spine01 CC_Base_Spine02", "CC_Base_NeckTwist01",
     "CC_Base_Head", "CC_Base_%_Clavicle CC_Base_%_Upperarm CC_Base_%_Forearm CC_Base_%_Hand",
     "CC_Base_%_Thigh CC_Base_%_Calf CC_Base_%_Foot CC_Base_%_ToeBase", "L", "R"},
    {"Quaternius", "Body", "Hips Abdomen Torso", "Neck", "Head", "Shoulder.% UpperArm.% LowerArm.% Palm.%",
     "UpperLeg.% LowerLeg.% Foot.% Toes.%", "L", "R"},
    {"LowerCase", "hips", "spine spine1", "neck", "head", "%shoulder %arm %forearm %hand",
     "%upleg %leg %foot %toebase", "left", "right"},
    {"MotionBuilderCharacter", "Character1_Hips", "Character1_Spine Character1_Spine1", "Character1_Neck",
     "Character1_Head", "Character1_%Shoulder Character1_%Arm Character1_%ForeArm Character1_%Hand",
     "Character1_%UpLeg Character1_%Leg Character1_%Foot Character1_%ToeBase", "Left", "Right"},
};

INSTANTIATE_TEST_SUITE_P(Schemes, WholeBody, testing::ValuesIn(kNamings),
                         [](const auto& naming) { return naming.param.label; });

TEST(Roles, names_and_roles_are_inverse) {
  for (int role = 0; role < kRoleCount; ++role)
    EXPECT_EQ(role_from_name(role_name(static_cast<Role>(role))), static_cast<Role>(role));
  EXPECT_EQ(role_from_name("tail"), std::nullopt);
}

TEST(Roles, left_leg_is_the_shin_where_there_is_an_up_leg_and_the_thigh_where_there_is_a_shin) {
  const Skeleton mixamo = skeleton_from("0:Hips 1:LeftUpLeg 2:LeftLeg 3:LeftFoot");
  EXPECT_EQ(name_of(mixamo, recognise_roles(mixamo), Role::left_lower_leg), "LeftLeg");
  const Skeleton soma = skeleton_from("0:Hips 1:LeftLeg 2:LeftShin 3:LeftFoot");
  EXPECT_EQ(name_of(soma, recognise_roles(soma), Role::left_upper_leg), "LeftLeg");
}

TEST(Roles, left_shoulder_is_the_upper_arm_where_the_forearm_is_an_elbow) {
  const Skeleton biovision =
      skeleton_from("0:Hips 1:Chest 2:LeftCollar 3:LeftShoulder 4:LeftElbow 5:LeftWrist");
  EXPECT_EQ(name_of(biovision, recognise_roles(biovision), Role::left_upper_arm), "LeftShoulder");
  const Skeleton mixamo = skeleton_from("0:Hips 1:Spine 2:LeftShoulder 3:LeftArm 4:LeftForeArm 5:LeftHand");
  EXPECT_EQ(name_of(mixamo, recognise_roles(mixamo), Role::left_shoulder), "LeftShoulder");
}

TEST(Roles, a_joint_that_hangs_elsewhere_plays_no_role) {
  // A foot controlled from the floor, as in rigs made for inverse kinematics.
  const Skeleton skeleton = skeleton_from(
      "0:Bone 1:Foot.L 1:Body 2:Hips 3:Abdomen 4:Torso 5:Neck 6:Head 2:UpperLeg.L 3:LowerLeg.L");
  const RoleMap map = recognise_roles(skeleton);
  EXPECT_EQ(name_of(skeleton, map, Role::hips), "Body");
  EXPECT_EQ(name_of(skeleton, map, Role::left_lower_leg), "LowerLeg.L");
  EXPECT_EQ(name_of(skeleton, map, Role::left_foot), "");
}

TEST(Roles, one_spine_joint_is_the_spine_and_two_are_spine_and_chest) {
  const Skeleton one = skeleton_from("0:Hips 1:Spine 2:Head");
  EXPECT_EQ(name_of(one, recognise_roles(one), Role::spine), "Spine");
  EXPECT_EQ(name_of(one, recognise_roles(one), Role::chest), "");
  const Skeleton two = skeleton_from("0:Hips 1:Spine 2:Spine1 3:Head");
  EXPECT_EQ(name_of(two, recognise_roles(two), Role::chest), "Spine1");
  EXPECT_EQ(name_of(two, recognise_roles(two), Role::upper_chest), "");
}

TEST(Roles, of_five_spine_joints_the_middle_is_the_chest_and_the_last_the_upper_chest) {
  const Skeleton five =
      skeleton_from("0:pelvis 1:spine_01 2:spine_02 3:spine_03 4:spine_04 5:spine_05 6:neck_01 7:head");
  const RoleMap map = recognise_roles(five);
  EXPECT_EQ(name_of(five, map, Role::spine), "spine_01");
  EXPECT_EQ(name_of(five, map, Role::chest), "spine_03");
  EXPECT_EQ(name_of(five, map, Role::upper_chest), "spine_05");
}

TEST(Roles, a_running_number_behind_every_name_is_no_part_of_it) {
  const Skeleton skeleton = skeleton_from(
      "0:Hips_01 1:Spine_02 2:Spine1_03 3:Neck_04 4:Head_05 3:LeftArm_06 4:LeftForeArm_07 5:LeftHand_08 "
      "1:LeftUpLeg_09 2:LeftLeg_010 3:LeftFoot_011");
  const RoleMap map = recognise_roles(skeleton);
  EXPECT_EQ(name_of(skeleton, map, Role::hips), "Hips_01");
  EXPECT_EQ(name_of(skeleton, map, Role::chest), "Spine1_03");
  EXPECT_EQ(name_of(skeleton, map, Role::left_lower_leg), "LeftLeg_010");
}

TEST(Roles, a_skeleton_in_no_known_scheme_plays_no_role) {
  const Skeleton skeleton = skeleton_from("0:Bone 1:Bone.001 2:Bone.002");
  const RoleMap map = recognise_roles(skeleton);
  EXPECT_EQ(map.scheme, "");
  EXPECT_EQ(map.joint_of_role, std::vector<int>(kRoleCount, -1));
}

TEST(Roles, an_empty_skeleton_plays_no_role) {
  EXPECT_EQ(recognise_roles(Skeleton{}).joint_of_role, std::vector<int>(kRoleCount, -1));
}

}  // namespace
}  // namespace sinew
