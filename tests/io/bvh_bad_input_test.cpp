#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "io/bvh.h"
#include "io/file_error.h"
#include "tests/io/small_bvh.h"

namespace sinew {
namespace {

using small_bvh::kHierarchy;
using small_bvh::kRows;
using small_bvh::kText;
using small_bvh::motion;
using small_bvh::one_joint;
using small_bvh::replaced;

const std::string kTime = "0.0333333";

std::string refusal_of(const std::string& text) {
  try {
    parse_bvh(text, "bad.bvh");
  } catch (const FileError& error) {
    EXPECT_EQ(error.fault(), FileFault::malformed);
    return error.what();
  }
  return "accepted";
}

/// Parses; what comes back must be whole and finite, what is thrown must be a FileError of one line.
/// True if a clip came back.
bool survives(const std::string& text) {
  try {
    const Clip clip = parse_bvh(text, "bad.bvh");
    check_skeleton(clip.skeleton, "parse_bvh");
    EXPECT_GT(clip.frame_count, 0);
    EXPECT_GT(clip.frames_per_second, 0.0);
    EXPECT_EQ(clip.local.size(), clip.skeleton.names.size() * clip.frame_count);
    for (const Transform& local : clip.local) {
      EXPECT_TRUE(local.translation.allFinite());
      EXPECT_NEAR(local.rotation.norm(), 1.0, 1e-12);
    }
    return true;
  } catch (const FileError& error) {
    const std::string message = error.what();
    EXPECT_EQ(message.rfind("bad.bvh:", 0), 0U) << message;
    EXPECT_EQ(message.find_first_of("\r\n"), std::string::npos) << message;
    return false;
  }
}

TEST(BvhRefusals, name_the_line_of_what_is_wrong_in_the_hierarchy) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"MOTION\n", "bad.bvh:1: found 'MOTION'; expected HIERARCHY"},
      {replaced(kText, "ROOT Hips", "JOINT Hips"), "bad.bvh:2: found 'JOINT'; expected ROOT"},
      {"HIERARCHY\n" + motion("1", "1", "1\n"), "bad.bvh:2: found MOTION; expected ROOT"},
      {replaced(kText, "ROOT Hips\n", "ROOT\n"), "bad.bvh:3: found ''; expected the name of a joint"},
      {replaced(kText, "Arm", std::string("A\0m", 3)), "bad.bvh:6: found 'A?m'; expected the name of a joint"},
      {replaced(kText, "ROOT Hips\n{", "ROOT Hips\n"), "bad.bvh:4: found 'OFFSET'; expected {"},
      {replaced(kText, "OFFSET 5.0 1.5 -2.0", "OFFSET 5.0 1.5"), "bad.bvh:9: found 'CHANNELS'; expected a number"},
      {replaced(kText, "OFFSET 5.0 1.5 -2.0", "OFFSET 5 1 2 3"),
       "bad.bvh:8: found '3'; expected OFFSET, CHANNELS, JOINT, End Site or '}' in joint 'Arm'"},
      {replaced(kText, "    OFFSET 5.0 1.5 -2.0\n", ""), "bad.bvh:13: joint 'Arm' ends; expected OFFSET in it"},
      {replaced(kText, "    OFFSET 5.0 1.5 -2.0\n", "OFFSET 1 2 3\nOFFSET 1 2 3\n"),
       "bad.bvh:9: a second OFFSET in joint 'Arm'; expected one"},
      {replaced(kText, "    End Site", "CHANNELS 0\nEnd Site"), "bad.bvh:10: a second CHANNELS in joint 'Arm'; expected one"},
      {replaced(kText, "CHANNELS 3", "CHANNELS 6"), "bad.bvh:9: joint 'Arm' lists 3 channels; expected 6 as CHANNELS says"},
      {replaced(kText, "CHANNELS 3", "CHANNELS 2"), "bad.bvh:9: joint 'Arm' lists 3 channels; expected 2 as CHANNELS says"},
      {replaced(kText, "CHANNELS 3", "CHANNELS 1000000000"),
       "bad.bvh:9: joint 'Arm' lists 3 channels; expected 1000000000 as CHANNELS says"},
      {replaced(kText, "CHANNELS 3", "CHANNELS -3"), "bad.bvh:9: found '-3'; expected the number of channels"},
      {replaced(kText, "CHANNELS 3", "CHANNELS"), "bad.bvh:9: found 'Zrotation'; expected the number of channels"},
      {replaced(kText, "CHANNELS 3 Zrotation", "CHANNELS 3 Wrotation"),
       "bad.bvh:9: found 'Wrotation'; expected a channel (Xposition, Yposition, Zposition, Xrotation, Yrotation or "
       "Zrotation)"},
      {replaced(kText, "Xposition Yposition", "Xposition Xposition"),
       "bad.bvh:5: joint 'Hips' lists Xposition twice; expected it once"},
      {replaced(kText, "End Site", "End"), "bad.bvh:11: found '{'; expected Site"},
      {replaced(kText, "      OFFSET 4.0 0.25 0.0\n", "JOINT x {}\n"), "bad.bvh:12: found 'JOINT'; expected }"},
      {replaced(kText, "}\nMOTION", "MOTION"), "bad.bvh:15: found MOTION; expected '}' for joint 'Hips'"},
      {replaced(kText, "}\nMOTION", "}}\nMOTION"), "bad.bvh:15: found '}'; expected MOTION"},
      {kHierarchy, "bad.bvh:16: the file ends; expected MOTION"},
      {"HIERARCHY\nROOT a { OFFSET 0 0 0 }\n" + motion("1", "1", "1\n"),
       "bad.bvh:3: no joint has channels; expected at least one that moves"},
  };
  for (const auto& [text, message] : cases) EXPECT_EQ(refusal_of(text), message);
}

TEST(BvhRefusals, name_the_line_of_what_is_wrong_in_the_motion) {
  const std::string short_row = replaced(kRows, "12.5 ", "");
  const std::vector<std::pair<std::string, std::string>> cases = {
      {kHierarchy + motion("-3", kTime, kRows), "bad.bvh:17: found '-3'; expected the number of frames"},
      {kHierarchy + motion("3.5", kTime, kRows), "bad.bvh:17: found '3.5'; expected the number of frames"},
      {kHierarchy + motion("18446744073709551616", kTime, kRows),
       "bad.bvh:17: found '18446744073709551616'; expected the number of frames"},
      {kHierarchy + motion("2147483647", kTime, kRows),
       "bad.bvh:17: Frames: says 2147483647, expected at most one for each of the 161 bytes that follow"},
      {kHierarchy + motion("1000000000000000000", kTime, kRows),
       "bad.bvh:17: Frames: says 1000000000000000000, expected at most one for each of the 161 bytes that follow"},
      {kHierarchy + motion("3\nFrames: 3", kTime, kRows), "bad.bvh:18: a second Frames:; expected one"},
      {kHierarchy + motion("3", kTime + "\nFrame Time: 1", kRows), "bad.bvh:19: a second Frame Time:; expected one"},
      {kHierarchy + motion("3", "-0.01", kRows),
       "bad.bvh:18: the frame time is out of range; expected seconds between 1e-6 and 3600"},
      {kHierarchy + motion("3", "1e-300", kRows),
       "bad.bvh:18: the frame time is out of range; expected seconds between 1e-6 and 3600"},
      {kHierarchy + motion("3", "fast", kRows), "bad.bvh:18: found 'fast'; expected a number"},
      {kHierarchy + motion("0", kTime, ""), "bad.bvh:19: no motion; expected rows of 9 values"},
      {kHierarchy + "MOTION\n", "bad.bvh:17: no motion; expected rows of 9 values"},
      {kHierarchy + motion("3", kTime, short_row), "bad.bvh:20: row has 8 values; expected 9"},
      {kHierarchy + motion("3", kTime, kRows + "1 1 1\n"), "bad.bvh:22: row has 3 values; expected 9"},
      {kHierarchy + motion("3", kTime, "1 2 3"), "bad.bvh:19: no motion; expected rows of 9 values"},
      {kHierarchy + motion("5", kTime, kRows + "that's all\n"), "bad.bvh:22: found 'that's'; expected a number"},
  };
  for (const auto& [text, message] : cases) EXPECT_EQ(refusal_of(text), message);
}

TEST(BvhRefusals, count_lines_whatever_ends_them) {
  const std::string text = replaced(kText, "12.5", "twelve");
  const std::string message = "bad.bvh:20: found 'twelve'; expected a number";
  EXPECT_EQ(refusal_of(text), message);
  EXPECT_EQ(refusal_of(replaced(text, "\n", "\r\n")), message);
  EXPECT_EQ(refusal_of(replaced(text, "\n", "\r")), message);
}

TEST(BvhRefusals, take_nothing_for_a_number_that_is_none) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"nan", "a finite number"}, {"-nan", "a finite number"}, {"NaN", "a finite number"}, {"inf", "a finite number"},
      {"-inf", "a finite number"}, {"Infinity", "a finite number"}, {"-nan(ind)", "a finite number"},
      {"1.#IND", "a number"}, {"-1.#QNAN", "a number"}, {"1e400", "a number of magnitude up to 1e12"},
      {"-1e308", "a number of magnitude up to 1e12"}, {std::string(30, '9'), "a number of magnitude up to 1e12"},
      {"0x10", "a number"}, {"1e", "a number"}, {"--1", "a number"}, {"+-1", "a number"}, {"++1", "a number"},
      {"1.2.3", "a number"}, {"1-2", "a number"}, {".", "a number"}, {"-", "a number"}, {"1;", "a number"},
      {"{", "a number"}, {"1_000", "a number"}, {"1,5,5", "a number"}};
  for (const auto& [word, expected] : cases) {
    EXPECT_EQ(refusal_of(one_joint("2 Xrotation Yrotation", "2.5 " + word)), "bad.bvh:10: found '" + word + "'; expected " + expected);
    EXPECT_EQ(refusal_of(replaced(kText, "1.5 -2.0", word + " -2.0")), "bad.bvh:8: found '" + word + "'; expected " + expected);
  }
  EXPECT_EQ(refusal_of(one_joint("1 Xrotation", "\xE2\x88\x92" "1")), "bad.bvh:10: found '???1'; expected a number");
}

TEST(BvhRefusals, take_no_comma_for_a_point_where_something_contradicts) {
  EXPECT_EQ(refusal_of(one_joint("1 Xrotation", "1,5")), "bad.bvh:10: found '1,5'; expected a number with a decimal point");
  const std::string commas = replaced(kText, ".", ",");
  EXPECT_EQ(refusal_of(replaced(commas, "Arm", "arm.R")), "bad.bvh:4: found '0,5'; expected a number with a decimal point");
  EXPECT_EQ(refusal_of(replaced(commas, "-40,0", "-40")), "bad.bvh:19: found '-40'; expected a number with a decimal comma, as before");
  EXPECT_EQ(refusal_of(replaced(commas, "-40,0", "-40,0,5")), "bad.bvh:19: found '-40,0,5'; expected a number");
}

TEST(BvhRefusals, say_what_the_file_is_instead) {
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n",
       "bad.bvh: is a Git LFS pointer, not a BVH file; fetch what it points to with 'git lfs pull'"},
      {"<!DOCTYPE html><html></html>", "bad.bvh: is a web page, not a BVH file; download the file itself"},
      {std::string("\xFF\xFEH\0I\0", 6), "bad.bvh: is UTF-16 text, not a BVH file; save it as UTF-8"},
      {std::string("\xFE\xFF\0H\0I", 6), "bad.bvh: is UTF-16 text, not a BVH file; save it as UTF-8"},
      {std::string("H\0I\0E\0", 6), "bad.bvh:1: found 'H?I?E?'; expected HIERARCHY"},
      {"", "bad.bvh:1: the file ends; expected HIERARCHY"},
      {" \r\n\t\n", "bad.bvh:3: the file ends; expected HIERARCHY"},
      {"Kaydara FBX Binary", "bad.bvh:1: found 'Kaydara'; expected HIERARCHY"},
  };
  for (const auto& [text, message] : cases) EXPECT_EQ(refusal_of(text), message);
}

TEST(BvhRefusals, come_before_memory_is_asked_for) {
  // Joints without channels cost the file nothing per frame: 30,000 of them, 10,000 frames.
  std::string text = "HIERARCHY\nROOT j { OFFSET 0 0 0 CHANNELS 1 Xrotation\n";
  for (int joint = 1; joint < 30'000; ++joint) text += "JOINT j{OFFSET 0 1 0}\n";
  text += "}\n" + motion("10000", "0.01", replaced(std::string(10'000, '0'), "0", "0\n"));
  try {
    parse_bvh(text, "bad.bvh");
    FAIL() << "accepted";
  } catch (const FileError& error) {
    EXPECT_EQ(error.fault(), FileFault::resource);
    EXPECT_STREQ(error.what(),
                 "bad.bvh: 10000 frames of 30000 joints, most of them without channels; at most 56 frames are read");
  }
}

TEST(BvhRefusals, tell_files_that_cannot_be_read_from_bad_ones) {
  try {
    read_bvh("no/such/file.bvh");
    FAIL() << "accepted";
  } catch (const FileError& error) {
    EXPECT_EQ(error.fault(), FileFault::input_output);
    EXPECT_STREQ(error.what(), "no/such/file.bvh: cannot open: No such file or directory");
  }
}

TEST(BvhDamage, every_prefix_gives_a_clip_or_a_refusal) {
  int clips = 0;
  for (std::size_t length = 0; length <= kText.size(); ++length) clips += survives(kText.substr(0, length));
  // All that end within the second row or later: a file cut there still has whole rows.
  EXPECT_GE(clips, static_cast<int>(kRows.size() - kRows.find('\n') - 1));
}

TEST(BvhDamage, every_changed_byte_gives_a_clip_or_a_refusal) {
  for (std::size_t at = 0; at < kText.size(); ++at) {
    std::string text = kText;
    for (const int byte : {0x00, 0xFF, static_cast<int>(' '), static_cast<int>('-'), static_cast<int>('9'),
                           static_cast<int>('\n'), static_cast<int>('{'), static_cast<int>('}'), kText[at] + 1, kText[at] - 1}) {
      text[at] = static_cast<char>(byte);
      survives(text);
    }
  }
}

TEST(BvhDamage, every_line_lost_or_doubled_gives_a_clip_or_a_refusal) {
  for (std::size_t begin = 0; begin < kText.size();) {
    const std::size_t end = kText.find('\n', begin) + 1;
    survives(kText.substr(0, begin) + kText.substr(end));
    survives(kText.substr(0, end) + kText.substr(begin));
    begin = end;
  }
}

/// A line of EXPECT.tsv: a file and what it must do. "v..." loads. "x..." is refused but for those
/// whose line leaves the choice and that we choose to load.
void expect_as_told(const std::filesystem::path& file, const std::string& told) {
  const std::set<std::string> loaded_by_choice = {"x02_truncated_motion.bvh", "x12_two_roots.bvh",
                                                  "x16_zero_frame_time.bvh", "x20_deep_nesting_20000.bvh"};
  SCOPED_TRACE(file.filename().string() + ": " + told);
  const std::string name = file.filename().string();
  try {
    const Clip clip = read_bvh(file);
    EXPECT_TRUE(name[0] == 'v' || loaded_by_choice.contains(name)) << "accepted";
    EXPECT_TRUE(told.find("warn") == std::string::npos || !clip.warnings.empty()) << "no warning";
    for (const Eigen::Vector3d& position : pose_at(clip, clip.frame_count - 1).positions) {
      EXPECT_TRUE(position.allFinite());
    }
  } catch (const FileError& error) {
    EXPECT_TRUE(name[0] == 'x' && !loaded_by_choice.contains(name)) << error.what();
    EXPECT_EQ(error.fault(), FileFault::malformed);
  }
}

TEST(BvhDamage, the_shared_bad_files_do_as_their_table_tells) {
  const std::filesystem::path folder = std::filesystem::path(SINEW_SHARED_DATA) / "bad/handmade-bvh";
  std::ifstream table(folder / "EXPECT.tsv");
  if (!table) GTEST_SKIP() << "no table " << folder / "EXPECT.tsv";
  int files = 0;
  for (std::string line; std::getline(table, line); ++files) {
    const std::size_t tab = line.find('\t');
    expect_as_told(folder / line.substr(0, tab), line.substr(tab + 1));
  }
  EXPECT_GE(files, 32);
}

}  // namespace
}  // namespace sinew
