#include "io/bvh.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/io/plain_bvh.h"
#include "tests/io/small_bvh.h"

namespace sinew {
namespace {

using small_bvh::kHierarchy;
using small_bvh::kRows;
using small_bvh::kText;
using small_bvh::motion;
using small_bvh::one_joint;
using small_bvh::replaced;

Clip parse(const std::string& text) { return parse_bvh(text, "small.bvh"); }

Eigen::Matrix3d turn(char axis, double degrees) { return plain_bvh::rotation(axis, degrees).topLeftCorner<3, 3>(); }

std::vector<std::filesystem::path> shared_clips() {
  std::vector<std::filesystem::path> clips;
  const std::filesystem::path folder = std::filesystem::path(SINEW_SHARED_DATA) / "bvh";
  if (!std::filesystem::is_directory(folder)) return clips;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.path().extension() == ".bvh") clips.push_back(entry.path());
  }
  std::sort(clips.begin(), clips.end());
  return clips;
}

void expect_same_motion(const Clip& clip, const Clip& other) {
  EXPECT_EQ(clip.skeleton.names, other.skeleton.names);
  EXPECT_EQ(clip.skeleton.parents, other.skeleton.parents);
  EXPECT_EQ(clip.skeleton.tips, other.skeleton.tips);
  EXPECT_EQ(clip.frames_per_second, other.frames_per_second);
  EXPECT_EQ(clip.frame_count, other.frame_count);
  ASSERT_EQ(clip.local.size(), other.local.size());
  for (std::size_t i = 0; i < clip.local.size(); ++i) {
    EXPECT_EQ(clip.local[i].translation, other.local[i].translation);
    EXPECT_EQ(clip.local[i].rotation.coeffs(), other.local[i].rotation.coeffs());
  }
}

/// World positions of joints and end sites, each joint's tips right after its subtree's turn in the
/// plain reading's order: a joint, then what its braces hold.
double greatest_difference(const Clip& clip, const plain_bvh::File& plain, int frame) {
  const std::vector<Eigen::Vector3d> expected = plain_bvh::positions(plain, frame);
  const std::vector<Eigen::Affine3d> world = world_matrices(clip.skeleton, clip.frame(frame));
  std::vector<int> joint_of_node(plain.nodes.size(), -1);
  std::vector<std::size_t> tips_seen(world.size(), 0);
  int joints = 0;
  double greatest = 0.0;
  for (std::size_t node = 0; node < plain.nodes.size(); ++node) {
    Eigen::Vector3d found;
    if (plain.nodes[node].end_site) {
      const int joint = joint_of_node[plain.nodes[node].parent];
      found = world[joint] * clip.skeleton.tips[joint].at(tips_seen[joint]++);
    } else {
      joint_of_node[node] = joints;
      found = world.at(joints++).translation();
    }
    greatest = std::max(greatest, (found - expected[node]).norm());
  }
  EXPECT_EQ(joints, clip.skeleton.joint_count());
  return greatest;
}

double extent(const std::vector<Eigen::Vector3d>& points) {
  Eigen::AlignedBox3d box;
  for (const Eigen::Vector3d& point : points) box.extend(point);
  return box.sizes().maxCoeff();
}

TEST(ReadBvh, places_joints_and_tips_of_every_shared_clip_where_a_plain_reading_does) {
  const auto clips = shared_clips();
  if (clips.empty()) GTEST_SKIP() << "no shared clips in " SINEW_SHARED_DATA "/bvh";
  EXPECT_GE(clips.size(), 14U);
  for (const std::filesystem::path& path : clips) {
    SCOPED_TRACE(path.filename());
    const Clip clip = read_bvh(path);
    const plain_bvh::File plain = plain_bvh::read(path);
    ASSERT_EQ(clip.frame_count, static_cast<int>(plain.rows.size()));
    const double height = extent(plain_bvh::positions(plain, 0));
    for (const int frame : {0, clip.frame_count / 2, clip.frame_count - 1}) {
      EXPECT_LT(greatest_difference(clip, plain, frame), 1e-9 * height) << "frame " << frame;
    }
  }
}

TEST(ReadBvh, keeps_bones_rigid_where_only_the_root_has_positions) {
  const auto clips = shared_clips();
  if (clips.empty()) GTEST_SKIP() << "no shared clips in " SINEW_SHARED_DATA "/bvh";
  int rigid_clips = 0;
  for (const std::filesystem::path& path : clips) {
    const plain_bvh::File plain = plain_bvh::read(path);
    const auto moves = [](const plain_bvh::Node& node) { return node.parent >= 0 && node.channels.size() > 3; };
    if (std::any_of(plain.nodes.begin(), plain.nodes.end(), moves)) continue;
    ++rigid_clips;
    SCOPED_TRACE(path.filename());
    const Clip clip = read_bvh(path);
    const double height = extent(plain_bvh::positions(plain, 0));
    double worst = 0.0;
    for (int frame = 0; frame < clip.frame_count; frame += 7) {
      const Pose pose = pose_at(clip, frame);
      for (int joint = 0; joint < clip.skeleton.joint_count(); ++joint) {
        const int parent = clip.skeleton.parents[joint];
        if (parent < 0) continue;
        const double length = (pose.positions[joint] - pose.positions[parent]).norm();
        worst = std::max(worst, std::abs(length - clip.skeleton.rest[joint].translation.norm()));
      }
    }
    EXPECT_LT(worst, 1e-11 * height);
  }
  EXPECT_GE(rigid_clips, 11);
}

TEST(ReadBvh, knows_the_rates_and_repairs_of_the_shared_clips) {
  if (shared_clips().empty()) GTEST_SKIP() << "no shared clips in " SINEW_SHARED_DATA "/bvh";
  const std::filesystem::path folder = std::filesystem::path(SINEW_SHARED_DATA) / "bvh";
  EXPECT_EQ(read_bvh(folder / "cmu-cgspeed/cmu_12_01_walk.bvh").frames_per_second, 120.0);
  EXPECT_EQ(read_bvh(folder / "cmu-daz/jumping_jacks.bvh").frames_per_second, 30.0);
  EXPECT_EQ(read_bvh(folder / "fair/jumping.bvh").frames_per_second, 1.0 / 0.008342);
  const std::filesystem::path boxing = folder / "cgclub-motionbuilder/Boxing_Toes.bvh";
  const Clip clip = read_bvh(boxing);
  EXPECT_EQ(clip.name, "Boxing_Toes");
  EXPECT_EQ(clip.frame_count, 3070);
  EXPECT_EQ(clip.warnings, std::vector<std::string>{"W_BVH_EXTRA_ROWS: " + boxing.string() +
                                                    ":128: 3070 rows of motion, Frames: says 3069; the rows present are used"});
}

TEST(ParseBvh, reads_names_parents_offsets_and_tips) {
  const Clip clip = parse(kText);
  EXPECT_EQ(clip.name, "small");
  EXPECT_EQ(clip.skeleton.names, (std::vector<std::string>{"Hips", "Arm"}));
  EXPECT_EQ(clip.skeleton.parents, (std::vector<int>{-1, 0}));
  EXPECT_EQ(clip.skeleton.rest[0].translation, Eigen::Vector3d(0.5, 10.0, 0.0));
  EXPECT_EQ(clip.skeleton.rest[1].translation, Eigen::Vector3d(5.0, 1.5, -2.0));
  EXPECT_TRUE(clip.skeleton.tips[0].empty());
  EXPECT_EQ(clip.skeleton.tips[1], std::vector<Eigen::Vector3d>{Eigen::Vector3d(4.0, 0.25, 0.0)});
  EXPECT_EQ(clip.frame_count, 3);
  EXPECT_EQ(clip.frames_per_second, 30.0);
  EXPECT_TRUE(clip.warnings.empty());
  check_skeleton(clip.skeleton, "parse_bvh");
}

TEST(ParseBvh, position_channels_replace_the_offset) {
  const Clip clip = parse(kText);
  EXPECT_EQ(clip.frame(1)[0].translation, Eigen::Vector3d(2.0, 11.5, -2.75));
  EXPECT_EQ(clip.frame(1)[1].translation, clip.skeleton.rest[1].translation);
  EXPECT_EQ(parse(one_joint("1 Yposition", "7")).frame(0)[0].translation, Eigen::Vector3d(1, 7, 3));
  EXPECT_EQ(parse(one_joint("3 Zposition Xposition Yposition", "7 8 9")).frame(0)[0].translation,
            Eigen::Vector3d(8, 9, 7));
}

TEST(ParseBvh, multiplies_rotations_in_the_order_of_their_channels) {
  const std::string axes = "XYZ";
  for (const char a : axes) {
    for (const char b : axes) {
      for (const char c : axes) {  // every order, repeated axes too
        const std::string channels = {'3', ' ', a, 'r', 'o', 't', 'a', 't', 'i', 'o', 'n', ' ', b, 'r', 'o', 't', 'a',
                                      't', 'i', 'o', 'n', ' ', c, 'r', 'o', 't', 'a', 't', 'i', 'o', 'n'};
        const Clip clip = parse(one_joint(channels, "20 -35 410"));
        const Eigen::Matrix3d expected = turn(a, 20) * turn(b, -35) * turn(c, 410);
        EXPECT_LT((clip.local[0].rotation.toRotationMatrix() - expected).norm(), 1e-14) << channels;
      }
    }
  }
}

TEST(ParseBvh, takes_any_mix_of_channels) {
  EXPECT_EQ(parse(one_joint("1 Xrotation", "90")).local[0].translation, Eigen::Vector3d(1, 2, 3));
  const Clip two = parse(one_joint("2 Zrotation Xrotation", "30 40"));
  EXPECT_LT((two.local[0].rotation.toRotationMatrix() - turn('Z', 30) * turn('X', 40)).norm(), 1e-15);
  const Clip rotation_first = parse(one_joint("6 Zrotation Xrotation Yrotation Xposition Yposition Zposition",
                                              "30 40 50 7 8 9"));
  EXPECT_EQ(rotation_first.local[0].translation, Eigen::Vector3d(7, 8, 9));
  EXPECT_LT((rotation_first.local[0].rotation.toRotationMatrix() - turn('Z', 30) * turn('X', 40) * turn('Y', 50)).norm(),
            1e-15);
  const Clip interleaved = parse(one_joint("4 Zrotation Xposition Xrotation Yposition", "30 7 40 8"));
  EXPECT_EQ(interleaved.local[0].translation, Eigen::Vector3d(7, 8, 3));
  EXPECT_LT((interleaved.local[0].rotation.toRotationMatrix() - turn('Z', 30) * turn('X', 40)).norm(), 1e-15);
}

TEST(ParseBvh, leaves_joints_without_channels_where_the_file_puts_them) {
  for (const std::string channels : {"CHANNELS 0", ""}) {
    const Clip clip = parse("HIERARCHY ROOT a { OFFSET 0 0 0 CHANNELS 1 Xrotation\n JOINT b { OFFSET 1 2 3 " + channels +
                            " } }\n" + motion("2", "0.01", "10\n20\n"));
    EXPECT_EQ(clip.frame(1)[1].translation, Eigen::Vector3d(1, 2, 3));
    EXPECT_EQ(clip.frame(1)[1].rotation.w(), 1.0);
  }
}

TEST(ParseBvh, keeps_names_as_they_are_written) {
  for (const std::string name : {"mixamorig:Hips", "upperleg01.R", "Left Arm", "root", "Bend", "End", "End Site", "MOTION",
                                 "Endsite", "#1", "JOINT", "Frames:", "OFFSET", "a-b/c", "h\xC3\xBC" "fte", "h\xFC" "fte"}) {
    const std::string text = replaced(kText, "JOINT Arm", "JOINT " + name);
    EXPECT_EQ(parse(text).skeleton.names[1], name);
    EXPECT_EQ(parse(replaced(text, name + "\n  {", name + " {")).skeleton.names[1], name);
    EXPECT_EQ(parse(replaced(text, name + "\n", name + "  \t\r\n")).skeleton.names[1], name);
    if (name[0] == '#') continue;  // on a line of its own it would be a comment
    EXPECT_EQ(parse(replaced(text, "JOINT " + name, "JOINT\n" + name)).skeleton.names[1], name);
  }
}

TEST(ParseBvh, tells_joints_of_one_name_apart_by_index) {
  const Clip clip = parse(replaced(kText, "Arm", "Hips"));
  EXPECT_EQ(clip.skeleton.names, (std::vector<std::string>{"Hips", "Hips"}));
  EXPECT_EQ(clip.skeleton.parents, (std::vector<int>{-1, 0}));
}

TEST(ParseBvh, takes_end_sites_in_every_shape) {
  const std::string site = "    End Site\n    {\n      OFFSET 4.0 0.25 0.0\n    }\n";
  const auto tips_with = [&](const std::string& other) { return parse(replaced(kText, site, other)).skeleton.tips[1]; };
  const std::vector<Eigen::Vector3d> one = {Eigen::Vector3d(4.0, 0.25, 0.0)};
  EXPECT_EQ(tips_with("End Site Arm_end { OFFSET 4 0.25 0 }"), one);
  EXPECT_EQ(tips_with("ENDSITE\n{ OFFSET 4 0.25 0 }"), one);
  EXPECT_EQ(tips_with("end site{OFFSET 4 0.25 0}"), one);
  EXPECT_EQ(tips_with(""), std::vector<Eigen::Vector3d>{});
  EXPECT_EQ(tips_with("End Site { OFFSET 0 0 0 }"), std::vector<Eigen::Vector3d>{Eigen::Vector3d::Zero()});
  EXPECT_EQ(tips_with(site + site).size(), 2U);
  const Clip beside_a_child = parse(replaced(kText, "  JOINT Arm", "  End Site { OFFSET 0 1 0 } JOINT Arm"));
  EXPECT_EQ(beside_a_child.skeleton.tips[0], std::vector<Eigen::Vector3d>{Eigen::Vector3d::UnitY()});
  const Clip without_offset = parse(replaced(kText, "      OFFSET 4.0 0.25 0.0\n", ""));
  EXPECT_TRUE(without_offset.skeleton.tips[1].empty());
  EXPECT_EQ(without_offset.warnings, std::vector<std::string>{"W_BVH_END_WITHOUT_OFFSET: small.bvh:10: an End Site without "
                                                              "OFFSET; it is left out"});
}

TEST(ParseBvh, reads_the_same_motion_in_every_dress) {
  const Clip clip = parse(kText);
  std::string lower = kText;
  std::transform(lower.begin(), lower.end(), lower.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  lower = replaced(replaced(lower, "hips", "Hips"), "arm", "Arm");
  std::string mixed = kText;
  for (std::size_t at = 0, line = 0; (at = mixed.find('\n', at)) != std::string::npos; ++line) {
    const std::string end = line % 3 == 0 ? "\r\n" : line % 3 == 1 ? "\r" : "\n";
    mixed.replace(at, 1, end);
    at += end.size();
  }
  const std::vector<std::string> dresses = {
      replaced(kText, "\n", "\r\n"),
      replaced(kText, "\n", "\r"),
      mixed,
      "\xEF\xBB\xBF" + kText,
      kText.substr(0, kText.size() - 1),
      replaced(kText, " ", "\t"),
      replaced(kText, " ", " \t  "),
      replaced(kText, " ", "\xC2\xA0"),
      replaced(kText, "\n", " \n"),
      replaced(kText, "\n", "\n\n"),
      replaced(kText, "\n  ", "\n"),
      replaced(kText, "\n", "\n  "),
      replaced(replaced(replaced(kText, "\n  {\n", " {\n"), "\n{\n", "{"), "}\n", "}"),
      "\n\n# made by hand\n\n" + kText,
      replaced(kText, "ROOT", "# a comment\nROOT"),
      replaced(kText, "0.0333333", ".0333333"),
      replaced(kText, "10.0", "+10."),
      replaced(kText, "-2.25", "-+2.25e+00"),
      replaced(kText, "-2.25", "-0002.25000000000000000000000000000000"),
      replaced(kText, "-2.25", "-225E-2"),
      replaced(kText, "Frames: 3", "Frames:3"),
      replaced(kText, "Frames: 3", "Frames :\t+3"),
      replaced(kText, "Frames: 3", "frames 3"),
      replaced(kText, "Frame Time:", "FRAME \t TIME :"),
      kHierarchy + "MOTION\nFrame Time: 0.0333333\nFrames: 3\n" + kRows,
      kHierarchy + "MOTION Frames: 3\n\n" + "Frame Time: 0.0333333\n\n" + kRows + "\n\n \t\n",
      lower,
  };
  for (const std::string& dress : dresses) {
    SCOPED_TRACE(dress);
    const Clip other = parse(dress);
    expect_same_motion(other, clip);
    EXPECT_TRUE(other.warnings.empty());
  }
}

TEST(ParseBvh, gives_the_rate_that_a_short_frame_time_means) {
  const std::vector<std::pair<std::string, double>> rates = {
      {"0.0333333", 30}, {"0.033333", 30}, {".03333", 30}, {".0083333", 120}, {"0.008333", 120}, {"0.041667", 24},
      {"0.01", 100}, {"0.04", 25}, {"1", 1}, {"0.03", 1 / 0.03}, {"0.008342", 1 / 0.008342},
      {"0.0333667", 1 / 0.0333667}, {"0.0417083750417", 1 / 0.0417083750417}, {"2.5", 0.4}};
  for (const auto& [frame_time, rate] : rates) {
    EXPECT_EQ(parse(kHierarchy + motion("3", frame_time, kRows)).frames_per_second, rate) << frame_time;
  }
}

TEST(ParseBvh, says_what_it_repairs) {
  const auto warning_of = [](const std::string& text, int frames) {
    const Clip clip = parse(text);
    EXPECT_EQ(clip.frame_count, frames);
    EXPECT_EQ(clip.frames_per_second, 30.0);
    EXPECT_EQ(clip.warnings.size(), 1U);
    return clip.warnings.empty() ? "" : clip.warnings[0];
  };
  const std::string good_time = "0.0333333";
  EXPECT_EQ(warning_of(kHierarchy + motion("2", good_time, kRows), 3),
            "W_BVH_EXTRA_ROWS: small.bvh:17: 3 rows of motion, Frames: says 2; the rows present are used");
  EXPECT_EQ(warning_of(kHierarchy + motion("9", good_time, kRows), 3),
            "W_BVH_MISSING_ROWS: small.bvh:17: 3 rows of motion, Frames: says 9; the rows present are used");
  EXPECT_EQ(warning_of(kHierarchy + motion("3", "0", kRows), 3),
            "W_BVH_NO_FRAME_TIME: small.bvh:18: no frame time, or zero; 30 frames per second are assumed");
  EXPECT_EQ(warning_of(kHierarchy + "MOTION\nFrames: 3\n" + kRows, 3),
            "W_BVH_NO_FRAME_TIME: small.bvh:16: no frame time, or zero; 30 frames per second are assumed");
  EXPECT_EQ(warning_of(kHierarchy + motion("3", "", kRows), 3),
            "W_BVH_NO_FRAME_TIME: small.bvh:18: no frame time, or zero; 30 frames per second are assumed");
  EXPECT_EQ(warning_of(kHierarchy + "MOTION\nFrame Time: 0.0333333\n" + kRows, 3),
            "W_BVH_NO_FRAME_COUNT: small.bvh:18: no number of frames; the 3 present are used");
  EXPECT_EQ(warning_of(kHierarchy + motion("3", good_time, replaced(kRows, " -2", "\n-2")), 3),
            "W_BVH_WRAPPED_ROWS: small.bvh:19: row has 2 values, a frame 9; values are taken without regard to lines");
  EXPECT_EQ(warning_of(kHierarchy + motion("3", good_time, replaced(kRows, "\n", " ")), 3),
            "W_BVH_WRAPPED_ROWS: small.bvh:19: row has 27 values, a frame 9; values are taken without regard to lines");
  EXPECT_EQ(warning_of(kText + "\n# exported by hand\n", 3),
            "W_BVH_TEXT_IN_MOTION: small.bvh:23: a comment between or after the rows; it is skipped");
  EXPECT_EQ(warning_of(kText + "that's all\nfolks\n", 3),
            "W_BVH_TEXT_IN_MOTION: small.bvh:22: found 'that's' after the last row; the rest is ignored");
  for (const std::string cut : {"1.0 2.0 3.", "1.0 2.0 -", "1.0 2.0 1e", "1 2 3 4 5 6 7 8 -", "-"}) {
    EXPECT_EQ(warning_of(kText + cut, 3),
              "W_BVH_CUT_ROW: small.bvh:22: the file ends inside a row; that row is left out");
  }
  EXPECT_EQ(warning_of(replaced(kHierarchy, "10.0", "1000") + motion("3", good_time, kRows), 3),
            "W_BVH_ROOT_AT_ORIGIN: small.bvh:19: the root starts at (1.5, 11, -2.25) though its OFFSET is "
            "(0.5, 1000, 0); positions replace OFFSET");
}

TEST(ParseBvh, reads_several_roots_as_several_trees) {
  const std::string two = kHierarchy + "ROOT Prop { OFFSET 1 2 3 CHANNELS 1 Xposition }\n";
  const Clip clip = parse(two + motion("1", "0.01", "1 2 3 4 5 6 7 8 9 10\n"));
  EXPECT_EQ(clip.skeleton.parents, (std::vector<int>{-1, 0, -1}));
  EXPECT_EQ(clip.local[2].translation, Eigen::Vector3d(10, 2, 3));
  EXPECT_EQ(clip.warnings, std::vector<std::string>{"W_BVH_SEVERAL_ROOTS: small.bvh:16: a second ROOT; the skeleton has "
                                                    "several trees"});
}

TEST(ParseBvh, takes_decimal_commas_only_where_nothing_contradicts) {
  const std::string commas = replaced(kText, ".", ",");
  const Clip clip = parse(commas);
  expect_same_motion(clip, parse(kText));
  EXPECT_EQ(clip.warnings,
            std::vector<std::string>{"W_BVH_DECIMAL_COMMA: small.bvh:4: numbers have a decimal comma; read as a point"});
}

TEST(ParseBvh, reads_tiny_numbers_as_nothing) {
  EXPECT_EQ(parse(one_joint("1 Xposition", "1e-400")).local[0].translation.x(), 0.0);
  EXPECT_EQ(parse(one_joint("1 Xposition", "-0." + std::string(400, '0') + "1")).local[0].translation.x(), 0.0);
  EXPECT_EQ(parse(one_joint("1 Xposition", "1e-40")).local[0].translation.x(), 1e-40);
  EXPECT_EQ(parse(one_joint("1 Xposition", "1." + std::string(400, '3'))).local[0].translation.x(), 4.0 / 3.0);
}

TEST(ParseBvh, follows_a_hundred_thousand_joints_down) {
  constexpr int kDepth = 100'000;
  std::string text = "HIERARCHY\nROOT j\n{ OFFSET 0 0 0 CHANNELS 1 Xrotation\n";
  for (int joint = 1; joint < kDepth; ++joint) text += "JOINT j\n{OFFSET 0 1 0\n";
  text += std::string(kDepth, '}') + "\n" + motion("1", "0.01", "90\n");
  const Clip clip = parse(text);
  EXPECT_EQ(clip.skeleton.joint_count(), kDepth);
  EXPECT_NEAR(pose_at(clip, 0).positions.back().z(), kDepth - 1.0, 1e-6);
}

}  // namespace
}  // namespace sinew
