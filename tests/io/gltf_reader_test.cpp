#include "io/gltf_reader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "io/file_error.h"
#include "tests/io/plain_gltf.h"
#include "tests/io/small_gltf.h"

namespace sinew {
namespace {

using small_gltf::File;
using small_gltf::joined;
using small_gltf::Json;
using small_gltf::ribbon;
using small_gltf::TemporaryFolder;
using small_gltf::translation_matrix;
using small_gltf::triangle;

const std::filesystem::path kData = std::filesystem::path(SINEW_SHARED_DATA) / "gltf";

GltfFile read(const File& file) {
  const TemporaryFolder folder;
  return GltfFile(folder.write("small.glb", file.glb()));
}

std::vector<std::filesystem::path> shared_files() {
  std::vector<std::filesystem::path> files;
  if (!std::filesystem::is_directory(kData)) return files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(kData)) {
    if (entry.path().extension() == ".glb" || entry.path().extension() == ".gltf")
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

double diagonal(const Field3& positions) {
  return (positions.colwise().maxCoeff() - positions.colwise().minCoeff()).norm();
}

bool mentions(const std::vector<std::string>& warnings, const std::string& code) {
  return std::any_of(warnings.begin(), warnings.end(),
                     [&](const std::string& line) { return line.starts_with(code); });
}

int joint_named(const Clip& clip, const std::string& name) {
  const auto& names = clip.skeleton.names;
  return static_cast<int>(std::find(names.begin(), names.end(), name) - names.begin());
}

Transform sampled(const File& file, const std::string& joint, double rate, int frame) {
  const Clip clip = read(file).clip("", rate);
  return clip.frame(frame)[joint_named(clip, joint)];
}

// ---- laws

TEST(GltfReader, a_skin_whose_nodes_stand_at_bind_leaves_mesh_and_joints_alone) {
  File file = ribbon();
  file.animate(0, 2, "translation", {0, 1}, {0, 1, 0, 0, 1, 0});
  const GltfFile gltf = read(file);
  const Motion motion = gltf.motion("", 10);
  const RigSkeleton rig = *gltf.rig();
  for (const Pose& pose : motion.poses) {
    for (int joint = 0; joint < rig.joint_count(); ++joint) {
      EXPECT_NEAR(pose.rotations[joint].angularDistance(Eigen::Quaterniond::Identity()), 0.0, 1e-12);
      EXPECT_NEAR((pose.positions[joint] - rig.joints[joint].position).norm(), 0.0, 1e-12);
      EXPECT_NEAR(pose.scales[joint], 1.0, 1e-12);
    }
  }
  EXPECT_NEAR((gltf.skinned_positions("", 0.5) - gltf.mesh().source_positions).norm(), 0.0, 1e-12);
}

TEST(GltfReader, the_file_s_rest_pose_does_not_bend_the_bind_pose) {
  const GltfFile straight = read(ribbon());
  File bent = ribbon();
  bent.json["nodes"][2]["rotation"] = {0, 0, std::sqrt(0.5), std::sqrt(0.5)};
  const GltfFile gltf = read(bent);
  EXPECT_NEAR((gltf.mesh().source_positions - straight.mesh().source_positions).norm(), 0.0, 1e-7);
  EXPECT_NEAR((gltf.rig()->joints[1].position - Eigen::Vector3d(0, 1, 0)).norm(), 0.0, 1e-7);
}

TEST(GltfReader, a_turned_topmost_joint_is_told_from_a_turned_mesh_by_the_mesh_s_node) {
  File leaning = ribbon();
  leaning.json["nodes"][1]["rotation"] = {0, 0, std::sin(0.1), std::cos(0.1)};
  leaning.json["nodes"][2]["rotation"] = {0, 0, std::sin(0.2), std::cos(0.2)};
  EXPECT_NEAR((read(leaning).mesh().source_positions - read(ribbon()).mesh().source_positions).norm(), 0.0,
              1e-7);
}

TEST(GltfReader, moving_everything_above_the_skeleton_moves_mesh_rig_and_motion_alike) {
  File file = ribbon();
  file.animate(0, 2, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, std::sqrt(0.5f), std::sqrt(0.5f)});
  File moved = file;
  moved.json["nodes"].push_back({{"name", "Armature"},
                                 {"scale", {0.01, 0.01, 0.01}},
                                 {"children", {0, 1}},
                                 {"rotation", {-std::sqrt(0.5), 0, 0, std::sqrt(0.5)}},
                                 {"translation", {1, 2, 3}}});
  moved.json["scenes"][0]["nodes"] = {3};
  const GltfFile first = read(file), second = read(moved);
  const Eigen::Affine3d above = Eigen::Translation3d(1, 2, 3) *
                                Eigen::AngleAxisd(-std::numbers::pi / 2, Eigen::Vector3d::UnitX()) *
                                Eigen::Scaling(0.01);
  const Field3 expected = (first.mesh().source_positions * above.linear().transpose()).rowwise() +
                          above.translation().transpose();
  EXPECT_NEAR((second.mesh().source_positions - expected).norm(), 0.0, 1e-8);
  const Motion plain = first.motion("", 4), turned = second.motion("", 4);
  for (int frame = 0; frame < plain.frame_count(); ++frame) {
    for (int joint = 0; joint < 2; ++joint) {
      const Eigen::Vector3d at = above * plain.poses[frame].positions[joint];
      EXPECT_NEAR((turned.poses[frame].positions[joint] - at).norm(), 0.0, 1e-8);
      const Eigen::Matrix3d turn = nearest_rotation(above.linear()) * plain.poses[frame].rotations[joint] *
                                   nearest_rotation(above.linear()).conjugate().toRotationMatrix();
      EXPECT_NEAR((turned.poses[frame].rotations[joint].toRotationMatrix() - turn).norm(), 0.0, 1e-7);
    }
  }
}

TEST(GltfReader, motion_carries_the_bind_mesh_where_skinning_puts_it) {
  if (shared_files().empty()) GTEST_SKIP() << "no shared data at " << kData;
  const std::filesystem::path path = kData / "khronos/Fox.gltf";
  const GltfFile gltf(path);
  const plain_gltf::File plain = plain_gltf::load(path);
  const RigSkeleton rig = *gltf.rig();
  const Field3 bind = gltf.mesh().source_positions;
  const Motion motion = gltf.motion("Run", 30);
  const Field3 expected = gltf.skinned_positions("Run", 7 / 30.0);
  const Json& attributes = plain.json["meshes"][0]["primitives"][0]["attributes"];
  double greatest = 0;
  for (int vertex = 0; vertex < bind.rows(); ++vertex) {
    const auto joints = plain_gltf::element(plain, attributes["JOINTS_0"], vertex);
    const auto weights = plain_gltf::element(plain, attributes["WEIGHTS_0"], vertex);
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();
    for (int i = 0; i < 4; ++i) {
      if (weights[i] == 0) continue;
      const int node = plain.json["skins"][0]["joints"][static_cast<int>(joints[i])];
      const int joint = rig.find(std::string(plain.json["nodes"][node]["name"]));
      ASSERT_GE(joint, 0);
      const Eigen::Vector3d arm = bind.row(vertex).transpose() - rig.joints[joint].position;
      moved += weights[i] * (motion.poses[7].rotations[joint] * arm + motion.poses[7].positions[joint]);
    }
    greatest = std::max(greatest, (moved - expected.row(vertex).transpose()).norm());
  }
  EXPECT_LT(greatest, 1e-5 * diagonal(bind));
}

// ---- agreement with the second reading

TEST(GltfReader, skinning_agrees_with_a_second_plain_reading_of_every_shared_file) {
  if (shared_files().empty()) GTEST_SKIP() << "no shared data at " << kData;
  for (const std::filesystem::path& path : shared_files()) {
    const GltfFile gltf(path);
    const plain_gltf::File plain = plain_gltf::load(path);
    const auto animations = gltf.animations();
    for (const std::size_t animation : {std::size_t{0}, animations.size() - 1}) {
      for (const double share : {0.0, 0.37, 0.81}) {
        const double time = share * animations[animation].seconds;
        const Field3 found = gltf.skinned_positions(std::to_string(animation), time);
        const std::vector<Eigen::Vector3d> expected =
            plain_gltf::vertices(plain, static_cast<int>(animation), time);
        ASSERT_EQ(found.rows(), static_cast<int>(expected.size())) << path;
        double greatest = 0;
        for (int row = 0; row < found.rows(); ++row) {
          greatest = std::max(greatest, (found.row(row).transpose() - expected[row]).norm());
        }
        EXPECT_LT(greatest, 1e-5 * diagonal(found)) << path << " animation " << animation << " at " << time;
      }
    }
  }
}

TEST(GltfReader, every_shared_file_gives_a_mesh_a_rig_and_a_motion_of_that_rig) {
  if (shared_files().empty()) GTEST_SKIP() << "no shared data at " << kData;
  for (const std::filesystem::path& path : shared_files()) {
    const GltfFile gltf(path);
    const MeshAsset asset = gltf.mesh();
    EXPECT_GT(asset.mesh.vertex_count(), 0) << path;
    EXPECT_EQ(asset.format, path.extension().string().substr(1));
    const auto rig = gltf.rig();
    ASSERT_TRUE(rig.has_value()) << path;
    check_rig_skeleton(*rig, "test");
    for (const GltfAnimationSummary& animation : gltf.animations()) {
      if (animation.name.empty()) continue;
      const Motion motion = gltf.motion(animation.name, 10);
      EXPECT_EQ(motion.frame_count(), static_cast<int>(std::floor(animation.seconds * 10 + 1e-3)) + 1)
          << path;
      EXPECT_EQ(motion.poses.front().joint_count(), rig->joint_count());
    }
    const Clip clip = gltf.clip("0", 30);
    check_skeleton(clip.skeleton, "test");
    EXPECT_EQ(clip.local.size(), clip.skeleton.names.size() * clip.frame_count);
  }
}

TEST(GltfReader, forward_kinematics_of_the_clip_meets_the_motion_s_joints) {
  if (shared_files().empty()) GTEST_SKIP() << "no shared data at " << kData;
  for (const char* name : {"khronos/Fox.gltf", "quaternius/Wolf.glb", "kaykit/Barbarian.glb"}) {
    const GltfFile gltf(kData / name);
    const RigSkeleton rig = *gltf.rig();
    const Clip clip = gltf.clip("0", 12);
    const Motion motion = gltf.motion("0", 12);
    const double size = diagonal(gltf.mesh().source_positions);
    for (int frame = 0; frame < clip.frame_count; ++frame) {
      const Pose pose = pose_at(clip, frame);
      for (int joint = 0; joint < rig.joint_count(); ++joint) {
        const Eigen::Vector3d found = pose.positions[joint_named(clip, rig.joints[joint].name)];
        ASSERT_NEAR((found - motion.poses[frame].positions[joint]).norm(), 0.0, 1e-9 * size) << name;
      }
    }
  }
}

// ---- interpolation

TEST(GltfReader, a_key_time_gives_the_key) {
  File file = ribbon();
  file.animate(0, 2, "translation", {0, 0.5f, 2}, {1, 2, 3, 4, 5, 6, 7, 8, 9});
  EXPECT_EQ(sampled(file, "Tip", 2, 0).translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(sampled(file, "Tip", 2, 1).translation, Eigen::Vector3d(4, 5, 6));
  EXPECT_EQ(sampled(file, "Tip", 2, 4).translation, Eigen::Vector3d(7, 8, 9));
}

TEST(GltfReader, linear_rotation_takes_the_shorter_arc_at_constant_speed) {
  File file = ribbon();  // the second key is the negative of a turn by 90 degrees
  const float half = std::sqrt(0.5f);
  file.animate(0, 2, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, -half, -half});
  const Eigen::Quaterniond third = sampled(file, "Tip", 3, 1).rotation;
  const Eigen::Quaterniond expected(Eigen::AngleAxisd(std::numbers::pi / 6, Eigen::Vector3d::UnitZ()));
  EXPECT_NEAR(third.angularDistance(expected), 0.0, 1e-7);
}

TEST(GltfReader, before_the_first_key_and_after_the_last_the_value_holds) {
  File file = ribbon();
  file.animate(0, 2, "translation", {1, 2}, {1, 0, 0, 2, 0, 0});
  file.animate(0, 1, "scale", {0, 4}, {1, 1, 1, 2, 2, 2});
  const Clip clip = read(file).clip("", 1);
  ASSERT_EQ(clip.frame_count, 5);
  const int tip = joint_named(clip, "Tip");
  const double expected[] = {1, 1, 2, 2, 2};
  for (int frame = 0; frame < 5; ++frame) EXPECT_EQ(clip.frame(frame)[tip].translation.x(), expected[frame]);
}

TEST(GltfReader, step_holds_until_the_next_key) {
  File file = ribbon();
  file.animate(0, 2, "translation", {0, 1, 2}, {1, 0, 0, 2, 0, 0, 3, 0, 0}, "STEP");
  const Clip clip = read(file).clip("", 4);
  const int tip = joint_named(clip, "Tip");
  for (int frame = 0; frame < clip.frame_count; ++frame) {
    EXPECT_EQ(clip.frame(frame)[tip].translation.x(), 1 + frame / 4) << frame;
  }
}

TEST(GltfReader, a_cubic_spline_is_the_bezier_curve_of_its_tangents) {
  File file = ribbon();  // keys at 1 and 3 seconds: in-tangent, value, out-tangent each
  file.animate(0, 2, "translation", {1, 3}, {9, 9, 9, 1, 2, 3, 4, -2, 1, 0, 5, -3, 6, 1, 2, 9, 9, 9},
               "CUBICSPLINE");
  const Eigen::Vector3d a(1, 2, 3), b(6, 1, 2), out(4, -2, 1), in(0, 5, -3);
  const double span = 2;
  for (int frame = 10; frame <= 30; ++frame) {
    const double s = (frame / 10.0 - 1) / span;
    std::vector<Eigen::Vector3d> points = {a, a + out * span / 3, b - in * span / 3, b};
    for (; points.size() > 1; points.pop_back()) {  // de Casteljau
      for (std::size_t i = 0; i + 1 < points.size(); ++i) points[i] = (1 - s) * points[i] + s * points[i + 1];
    }
    EXPECT_NEAR((sampled(file, "Tip", 10, frame).translation - points[0]).norm(), 0.0, 1e-12) << frame;
  }
}

TEST(GltfReader, a_cubic_rotation_is_normalized) {
  File file = ribbon();
  const float half = std::sqrt(0.5f);
  file.animate(0, 2, "rotation", {0, 1},
               {0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, half, half, 0, 0, 0, 0}, "CUBICSPLINE");
  const Eigen::Quaterniond middle = sampled(file, "Tip", 2, 1).rotation;
  EXPECT_NEAR(middle.norm(), 1.0, 1e-12);
  EXPECT_NEAR(middle.angularDistance(
                  Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 4, Eigen::Vector3d::UnitZ()))),
              0.0, 1e-7);
}

TEST(GltfReader, integer_rotations_are_dequantized) {
  File file = ribbon();
  const int times = file.add_floats("SCALAR", {0, 1});
  const int values = file.add<std::int8_t>("VEC4", 5120, {0, 0, 0, 127, 0, 0, 127, -128}, true);
  file.animate_with(0, 2, "rotation", times, values);
  const Eigen::Quaterniond last = sampled(file, "Tip", 1, 1).rotation;
  EXPECT_NEAR((last.coeffs() - Eigen::Vector4d(0, 0, 1, -1).normalized()).norm(), 0.0, 1e-12);
}

TEST(GltfReader, one_key_and_no_length_is_one_frame) {
  File file = ribbon();
  file.animate(0, 2, "translation", {0}, {3, 0, 0});
  const Clip clip = read(file).clip("", 30);
  EXPECT_EQ(clip.frame_count, 1);
  EXPECT_EQ(clip.frame(0)[joint_named(clip, "Tip")].translation.x(), 3);
  EXPECT_EQ(read(file).motion("", 30).frame_count(), 1);
}

TEST(GltfReader, nodes_that_no_channel_moves_stay_where_the_file_puts_them) {
  File file = ribbon();
  file.json["nodes"][1]["matrix"] = {0, 2, 0, 0, -2, 0, 0, 0,
                                     0, 0, 2, 0, 5,  6, 7, 1};  // a quarter turn about z, doubled
  file.animate(0, 2, "translation", {0, 1}, {0, 1, 0, 0, 2, 0});
  const Clip clip = read(file).clip("", 1);
  const Transform root = clip.frame(1)[joint_named(clip, "Root")];
  EXPECT_EQ(root.translation, Eigen::Vector3d(5, 6, 7));
  EXPECT_NEAR((root.scale - Eigen::Vector3d::Constant(2)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(root.rotation.angularDistance(
                  Eigen::Quaterniond(Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()))),
              0.0, 1e-12);
}

TEST(GltfReader, morph_channels_are_ignored_with_a_warning) {
  File file = ribbon();
  file.animate(0, 2, "translation", {0, 1}, {0, 1, 0, 0, 2, 0});
  const int times = file.add_floats("SCALAR", {0, 9});
  file.animate_with(0, 0, "weights", times, times);
  const Clip clip = read(file).clip("", 1);
  EXPECT_EQ(clip.frame_count, 2);
  EXPECT_TRUE(mentions(clip.warnings, "W_GLTF_WEIGHTS"));
}

TEST(GltfReader, animations_go_by_name_or_number) {
  File file = ribbon();
  file.animate(0, 2, "translation", {0, 1}, {0, 1, 0, 0, 2, 0});
  file.animate(1, 1, "translation", {0, 3}, {0, 1, 0, 0, 2, 0});
  file.json["animations"][0]["name"] = "walk";
  file.json["animations"][1]["name"] = "run";
  const GltfFile gltf = read(file);
  EXPECT_EQ(gltf.clip("", 1).name, "walk");
  EXPECT_EQ(gltf.clip("run", 1).frame_count, 4);
  EXPECT_EQ(gltf.clip("1", 1).name, "run");
  ASSERT_EQ(gltf.animations().size(), 2u);
  EXPECT_EQ(gltf.animations()[1].seconds, 3);
  EXPECT_EQ(gltf.animations()[1].joints, 1);
  try {
    gltf.clip("fly", 1);
    FAIL();
  } catch (const FileError& error) {
    EXPECT_EQ(error.fault(), FileFault::unusable);
    EXPECT_TRUE(std::string(error.what())
                    .ends_with("has no animation 'fly'; expected one of 'walk', 'run' or 0 to 1"));
  }
}

// ---- meshes

TEST(GltfReader, strips_and_fans_become_triangles_of_the_same_side) {
  for (const int mode : {5, 6}) {
    File file = triangle();
    const int position =
        file.add_floats("VEC3", mode == 5 ? std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0}
                                          : std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, -1, 1, 0});
    file.json["meshes"][0]["primitives"][0] = {{"attributes", {{"POSITION", position}}}, {"mode", mode}};
    const MeshAsset asset = read(file).mesh();
    ASSERT_EQ(asset.mesh.triangles.size(), 3u);
    for (const auto& corners : asset.mesh.triangles) {
      const Eigen::Vector3d a = asset.mesh.positions.row(corners[0]),
                            b = asset.mesh.positions.row(corners[1]),
                            c = asset.mesh.positions.row(corners[2]);
      EXPECT_GT((b - a).cross(c - a).z(), 0.0);
    }
  }
}

TEST(GltfReader, points_and_lines_are_left_out_with_one_warning) {
  File file = triangle();
  Json points = file.json["meshes"][0]["primitives"][0];
  points["mode"] = 0;
  file.json["meshes"][0]["primitives"].push_back(points);
  const MeshAsset asset = read(file).mesh();
  EXPECT_EQ(asset.primitives.size(), 1u);
  EXPECT_TRUE(mentions(asset.warnings, "W_GLTF_PRIMITIVE: 1 "));
}

TEST(GltfReader, only_the_default_scene_is_drawn) {
  File file = triangle();
  file.json["nodes"].push_back({{"mesh", 0}, {"translation", {5, 0, 0}}});
  file.json["scenes"].push_back({{"nodes", {0, 1}}});
  EXPECT_EQ(read(file).mesh().primitives.size(), 1u);
  file.json["scene"] = 1;
  const MeshAsset both = read(file).mesh();
  EXPECT_EQ(both.primitives.size(), 2u);
  EXPECT_EQ(both.source_positions.row(3), Eigen::RowVector3d(5, 0, 0));
  file.json.erase("scene");
  file.json.erase("scenes");
  EXPECT_EQ(read(file).mesh().primitives.size(), 2u);
}

TEST(GltfReader, a_mirrored_node_keeps_its_triangles_facing_out) {
  File file = triangle();
  file.json["nodes"][0]["scale"] = {-1, 1, 1};
  const MeshAsset asset = read(file).mesh();
  EXPECT_EQ(asset.primitives[0].indices, (std::vector<std::uint32_t>{0, 2, 1}));
}

TEST(GltfReader, attributes_keep_their_own_type_and_directions_turn_with_the_mesh) {
  File file = triangle();
  Json& attributes = file.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["NORMAL"] = file.add_floats("VEC3", {0, .6f, .8f, 0, .6f, .8f, 0, .6f, .8f});
  attributes["TEXCOORD_0"] = file.add<std::uint16_t>("VEC2", 5123, {0, 1, 2, 3, 4, 5}, true);
  const MeshAsset as_is = read(file).mesh();
  file.json["nodes"][0]["rotation"] = {0, std::sqrt(0.5), 0, std::sqrt(0.5)};
  file.json["nodes"][0]["scale"] = {1, 1, 7};
  const MeshAsset turned = read(file).mesh();
  const auto named = [](const MeshAsset& asset, const std::string& name) {
    for (const VertexAttribute& attribute : asset.primitives[0].attributes) {
      if (attribute.name == name) return attribute;
    }
    return VertexAttribute{};
  };
  EXPECT_EQ(named(as_is, "TEXCOORD_0").component_type, 5123);
  EXPECT_TRUE(named(as_is, "TEXCOORD_0").normalized);
  EXPECT_EQ(named(as_is, "TEXCOORD_0").data, named(turned, "TEXCOORD_0").data);
  float normal[3];
  std::memcpy(normal, named(turned, "NORMAL").data.data(), sizeof normal);
  // Stretched along z, a normal leans away from z; then z turns into x.
  const Eigen::Vector3d expected = Eigen::Vector3d(0.8 / 7, 0.6, 0).normalized();
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(normal[i], expected[i], 1e-6);
}

TEST(GltfReader, sparse_values_replace_and_views_interleave) {
  File file = triangle();
  const std::vector<float> rows = {1, 2, 3, 99, 4, 5, 6, 99, 7, 8, 9, 99};
  const int position = file.add_floats("VEC4", rows);  // three floats and one of padding
  const int index = file.add<std::uint8_t>("SCALAR", 5121, {1});
  const int value = file.add_floats("VEC3", {40, 50, 60});
  Json& accessor = file.json["accessors"][position];
  accessor["type"] = "VEC3";
  file.json["bufferViews"][position]["byteStride"] = 16;
  accessor["sparse"] = {{"count", 1},
                        {"indices", {{"bufferView", index}, {"componentType", 5121}}},
                        {"values", {{"bufferView", value}}}};
  file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = position;
  Field3 expected(3, 3);
  expected << 1, 2, 3, 40, 50, 60, 7, 8, 9;
  EXPECT_EQ(read(file).mesh().source_positions, expected);
}

TEST(GltfReader, quantized_positions_are_read_through_the_bind_matrices) {
  File file = ribbon();
  const int position = file.add<std::int16_t>(
      "VEC3", 5122, {0, 0, 0, 16384, 0, 0, 0, 16384, 0, 16384, 16384, 0, 0, 32767, 0, 16384, 32767, 0}, true);
  const std::vector<float> doubled = {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0};
  const int bind =
      file.add_floats("MAT4", joined(joined(doubled, {0, 0, 0, 1}), joined(doubled, {0, -1, 0, 1})));
  file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = position;
  file.json["skins"][0]["inverseBindMatrices"] = bind;
  file.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  const GltfFile gltf = read(file);
  EXPECT_NEAR((gltf.mesh().source_positions - read(ribbon()).mesh().source_positions).cwiseAbs().maxCoeff(),
              0.0, 1e-4);
  EXPECT_NEAR(gltf.rig()->joints[1].position.y(), 1.0, 1e-6);
}

TEST(GltfReader, weights_that_do_not_sum_to_one_are_normalized_with_a_warning) {
  File file = ribbon();
  file.animate(0, 1, "translation", {0, 1}, {0, 0, 0, 4, 0, 0});
  std::vector<float> weights(24, 0.0f);
  for (int vertex = 0; vertex < 6; ++vertex) weights[4 * vertex] = 0.25f;
  file.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = file.add_floats("VEC4", weights);
  const GltfFile gltf = read(file);
  const Field3 moved = gltf.skinned_positions("", 1);
  EXPECT_NEAR((moved - gltf.mesh().source_positions).col(0).minCoeff(), 4.0, 1e-12);
  EXPECT_TRUE(mentions(gltf.mesh().warnings, "W_GLTF_WEIGHTS_SUM: 6 "));
}

// ---- skins and rigs

TEST(GltfReader, without_inverse_bind_matrices_they_are_identities) {
  File file = ribbon();
  file.json["skins"][0].erase("inverseBindMatrices");
  file.json["nodes"][2]["translation"] = {0, 0, 0};
  const GltfFile gltf = read(file);
  EXPECT_EQ(gltf.mesh().source_positions, read(ribbon()).mesh().source_positions);
  EXPECT_EQ(gltf.rig()->joints[1].position, Eigen::Vector3d(0, 0, 0));
}

TEST(GltfReader, a_rig_lists_parents_first_and_looks_through_helper_nodes) {
  File file = ribbon();  // the skin lists the child first, and a helper stands between the two
  file.json["nodes"][1]["children"] = {3};
  file.json["nodes"].push_back({{"name", "Helper"}, {"children", {2}}, {"translation", {0, 0.25, 0}}});
  file.json["nodes"][2]["translation"] = {0, 0.75, 0};
  file.json["skins"][0]["joints"] = {2, 1};
  file.json["skins"][0]["inverseBindMatrices"] =
      file.add_floats("MAT4", joined(translation_matrix(0, -1, 0), translation_matrix(0, 0, 0)));
  file.animate(0, 3, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, 1, 0});
  const GltfFile gltf = read(file);
  const RigSkeleton rig = *gltf.rig();
  ASSERT_EQ(rig.joint_count(), 2);
  EXPECT_EQ(rig.joints[0].name, "Root");
  EXPECT_EQ(rig.joints[1].name, "Tip");
  EXPECT_EQ(rig.parents(), (std::vector<int>{-1, 0}));
  const Motion motion = gltf.motion("", 1);  // turning the helper swings the tip below it
  EXPECT_NEAR((motion.poses[1].positions[1] - Eigen::Vector3d(0, -0.5, 0)).norm(), 0.0, 1e-6);
}

TEST(GltfReader, joints_that_move_nothing_are_left_out) {
  File file = ribbon();
  file.json["nodes"][1]["children"] = {2, 3};
  file.json["nodes"].push_back({{"name", "PoleTarget"}, {"translation", {0, 0, 9}}});
  file.json["skins"][0]["joints"] = {1, 2, 3};
  file.json["skins"][0]["inverseBindMatrices"] =
      file.add_floats("MAT4", joined(joined(translation_matrix(0, 0, 0), translation_matrix(0, -1, 0)),
                                     translation_matrix(0, 0, -9)));
  EXPECT_EQ(read(file).rig()->joint_count(), 2);
  EXPECT_EQ(read(file).skins()[0].joints, 3);
}

TEST(GltfReader, a_leaf_s_tip_lies_inside_what_it_moves) {
  const RigSkeleton rig = *read(ribbon()).rig();
  EXPECT_FALSE(rig.joints[0].tip.has_value());
  ASSERT_TRUE(rig.joints[1].tip.has_value());
  EXPECT_GT(rig.joints[1].tip->y(), 1.5);
  EXPECT_LT(rig.joints[1].tip->y(), 2.0);
}

TEST(GltfReader, equal_and_missing_names_become_unique) {
  File file = ribbon();
  file.json["nodes"][1]["name"] = "Bone";
  file.json["nodes"][2]["name"] = "Bone";
  EXPECT_EQ(read(file).rig()->joints[1].name, "Bone_2");
  file.json["nodes"][2].erase("name");
  EXPECT_EQ(read(file).rig()->joints[1].name, "joint_1");
}

TEST(GltfReader, skins_that_share_joints_make_one_rig) {
  File file = ribbon();
  file.json["skins"].push_back(
      {{"joints", {2}}, {"inverseBindMatrices", file.add_floats("MAT4", translation_matrix(0, -1, 0))}});
  file.json["nodes"].push_back({{"mesh", 1}, {"skin", 1}});
  file.json["scenes"][0]["nodes"].push_back(3);
  const int position = file.add_floats("VEC3", {0, 2, 0, 1, 2, 0, 0, 3, 0});
  const int joints = file.add<std::uint8_t>("VEC4", 5121, std::vector<std::uint8_t>(12, 0));
  const int weights = file.add<std::uint8_t>("VEC4", 5121, {255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0}, true);
  file.json["meshes"].push_back(
      {{"primitives",
        {{{"attributes", {{"POSITION", position}, {"JOINTS_0", joints}, {"WEIGHTS_0", weights}}}}}}});
  file.animate(0, 2, "translation", {0, 1}, {0, 1, 0, 0, 1, 5});
  const GltfFile gltf = read(file);
  EXPECT_EQ(gltf.rig()->joint_count(), 2);
  const MeshAsset asset = gltf.mesh();
  EXPECT_EQ(asset.source_positions.row(8), Eigen::RowVector3d(0, 3, 0));
  EXPECT_FALSE(mentions(asset.warnings, "W_GLTF_BIND"));
  EXPECT_EQ(gltf.skinned_positions("", 1).row(8), Eigen::RowVector3d(0, 3, 5));
}

TEST(GltfReader, a_mesh_hung_under_a_joint_follows_it_rigidly_from_the_bind_pose) {
  File file = ribbon();  // at rest the tip is turned, so the hat below it is too; at bind it is not
  file.json["nodes"][2]["rotation"] = {0, 0, 1, 0};
  file.json["nodes"][2]["children"] = {3};
  file.json["nodes"].push_back({{"name", "Hat"}, {"mesh", 1}, {"translation", {0, 1, 0}}});
  const int position = file.add_floats("VEC3", {0, 0, 0, 1, 0, 0, 0, 1, 0});
  file.json["meshes"].push_back({{"primitives", {{{"attributes", {{"POSITION", position}}}}}}});
  file.animate(0, 2, "rotation", {0}, {0, 0, 1, 0});
  const GltfFile gltf = read(file);
  // Parts come in the order of the tree: the ribbon's six vertices, then the hat's.
  EXPECT_NEAR((gltf.mesh().source_positions.row(6) - Eigen::RowVector3d(0, 2, 0)).norm(), 0.0, 1e-6);
  EXPECT_NEAR((gltf.skinned_positions("", 0).row(6) - Eigen::RowVector3d(0, 0, 0)).norm(), 0.0, 1e-6);
}

TEST(GltfReader, scale_goes_into_the_pose_s_scales_and_not_into_its_rotations) {
  File file = ribbon();
  file.animate(0, 2, "scale", {0, 1}, {1, 1, 1, 2, 2, 2});
  const Motion motion = read(file).motion("", 1);
  EXPECT_NEAR(motion.poses[1].scales[1], 2.0, 1e-12);
  EXPECT_NEAR(motion.poses[1].rotations[1].angularDistance(Eigen::Quaterniond::Identity()), 0.0, 1e-12);
}

TEST(GltfReader, a_file_without_a_skin_has_no_rig_but_a_clip) {
  File file = triangle();
  file.animate(0, 0, "translation", {0, 1}, {0, 0, 0, 4, 0, 0});
  const GltfFile gltf = read(file);
  EXPECT_FALSE(gltf.rig().has_value());
  EXPECT_EQ(gltf.clip("", 1).frame_count, 2);
  EXPECT_THROW(gltf.motion("", 1), FileError);
}

// ---- appearance

File textured(const Json& images) {
  File file = triangle();
  file.json["images"] = images;
  file.json["samplers"] = {{{"wrapS", 33071}}};
  for (std::size_t i = 0; i < images.size(); ++i)
    file.json["textures"].push_back({{"source", i}, {"sampler", 0}});
  for (std::size_t i = 0; i < images.size(); ++i) {
    file.json["materials"].push_back(
        {{"name", "m" + std::to_string(i)},
         {"pbrMetallicRoughness", {{"baseColorTexture", {{"index", i}}}}},
         {"extensions",
          {{"KHR_materials_clearcoat", {{"clearcoatTexture", {{"index", i}, {"texCoord", 1}}}}}}}});
  }
  file.json["meshes"][0]["primitives"][0]["material"] = 0;
  return file;
}

TEST(GltfReader, materials_travel_with_their_images_wherever_these_lie) {
  const TemporaryFolder folder;
  folder.write("a b.png", "\x89PNG outside");
  File file = textured({{{"uri", "a%20b.png"}}, {{"uri", "data:image/jpeg;base64,/9j/4A=="}}});
  const int in_view = file.add<char>("SCALAR", 5120, {'\x89', 'P', 'N', 'G'});
  file.json["images"].push_back({{"bufferView", in_view}, {"mimeType", "image/png"}, {"name", "third"}});
  const MeshAsset asset = GltfFile(folder.write("x.glb", file.glb())).mesh();
  ASSERT_EQ(asset.images.size(), 3u);
  EXPECT_EQ(asset.images[0].name, "a%20b.png");
  EXPECT_EQ(asset.images[0].mime_type, "image/png");
  EXPECT_EQ(asset.images[0].bytes.size(), 12u);
  EXPECT_EQ(asset.images[1].mime_type, "image/jpeg");
  EXPECT_EQ(asset.images[1].bytes.size(), 4u);
  EXPECT_EQ(asset.images[2].name, "third");
  const Json appearance = Json::parse(asset.appearance_json);
  EXPECT_EQ(appearance["images"][0], Json::parse(R"({"source": 0, "mimeType": "image/png"})"));
  EXPECT_EQ(appearance["materials"], file.json["materials"]);
  EXPECT_EQ(appearance["textures"], file.json["textures"]);
  EXPECT_EQ(appearance["samplers"], file.json["samplers"]);
  EXPECT_EQ(appearance["extensionsUsed"], Json::array({"KHR_materials_clearcoat"}));
  EXPECT_TRUE(asset.warnings.empty());
}

TEST(GltfReader, an_image_that_cannot_be_had_costs_its_textures_and_one_warning) {
  const File file =
      textured({{{"uri", "gone.png"}}, {{"uri", "../up.png"}}, {{"uri", "data:image/png;base64,iVBORw=="}}});
  const MeshAsset asset = read(file).mesh();
  ASSERT_EQ(asset.images.size(), 1u);
  const Json appearance = Json::parse(asset.appearance_json);
  ASSERT_EQ(appearance["textures"].size(), 1u);
  EXPECT_EQ(appearance["textures"][0]["source"], 0);
  EXPECT_FALSE(appearance["materials"][0]["pbrMetallicRoughness"].contains("baseColorTexture"));
  EXPECT_EQ(appearance["materials"][0]["extensions"]["KHR_materials_clearcoat"], Json::object());
  EXPECT_EQ(appearance["materials"][2]["pbrMetallicRoughness"]["baseColorTexture"]["index"], 0);
  EXPECT_EQ(asset.warnings.size(), 1u);
  EXPECT_TRUE(mentions(asset.warnings, "W_GLTF_IMAGE: 2 "));
}

}  // namespace
}  // namespace sinew
