#pragma once

#include <string>

namespace sinew::small_bvh {

/// Root and arm, six and three channels, one end site.
inline const std::string kHierarchy =
    "HIERARCHY\n"
    "ROOT Hips\n"
    "{\n"
    "  OFFSET 0.5 10.0 0.0\n"
    "  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
    "  JOINT Arm\n"
    "  {\n"
    "    OFFSET 5.0 1.5 -2.0\n"
    "    CHANNELS 3 Zrotation Xrotation Yrotation\n"
    "    End Site\n"
    "    {\n"
    "      OFFSET 4.0 0.25 0.0\n"
    "    }\n"
    "  }\n"
    "}\n";

inline const std::string kRows =
    "1.5 11.0 -2.25 10.0 20.0 30.0 -40.0 5.5 -0.125\n"
    "2.0 11.5 -2.75 12.5 22.0 31.0 -42.0 6.5 1.0e1\n"
    "2.5 12.0 -3.25 15.0 24.0 32.0 -44.0 7.5 20.0\n";

inline std::string motion(const std::string& frames, const std::string& frame_time, const std::string& rows) {
  return "MOTION\nFrames: " + frames + "\nFrame Time: " + frame_time + "\n" + rows;
}

inline const std::string kText = kHierarchy + motion("3", "0.0333333", kRows);

/// One ROOT without children, its OFFSET (1, 2, 3): its channels, and one row of values.
inline std::string one_joint(const std::string& channels, const std::string& row) {
  return "HIERARCHY\nROOT one\n{\nOFFSET 1 2 3\nCHANNELS " + channels + "\n}\n" + motion("1", "0.01", row + "\n");
}

inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
    text.replace(at, from.size(), to);
  }
  return text;
}

}  // namespace sinew::small_bvh
