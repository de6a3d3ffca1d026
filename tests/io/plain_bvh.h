#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

/// A second reading of well-formed BVH files, as plain as can be and on purpose unlike the first:
/// line by line, streams for numbers, and 4 x 4 matrices written out entry by entry.
namespace sinew::plain_bvh {

struct Node {
  bool end_site = false;
  int parent = -1;  // a node
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  std::vector<std::string> channels;
};

struct File {
  std::vector<Node> nodes;  // joints and end sites, as they come
  std::vector<std::vector<double>> rows;
};

inline std::vector<std::string> words_of(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

inline File read(const std::filesystem::path& path) {
  File file;
  std::ifstream stream(path);
  std::vector<int> open;
  bool motion = false;
  for (std::string line; std::getline(stream, line);) {
    const std::vector<std::string> words = words_of(line);
    if (words.empty() || words[0] == "HIERARCHY") continue;
    if (words[0] == "MOTION") motion = true;
    if (motion && words[0] != "MOTION" && words[0].substr(0, 5) != "Frame") {
      std::vector<double> row;
      for (const std::string& word : words) row.push_back(std::stod(word));
      file.rows.push_back(row);
    } else if (words[0] == "ROOT" || words[0] == "JOINT" || words[0] == "End") {
      Node node;
      node.end_site = words[0] == "End";
      node.parent = open.empty() ? -1 : open.back();
      open.push_back(static_cast<int>(file.nodes.size()));
      file.nodes.push_back(node);
    } else if (words[0] == "OFFSET") {
      file.nodes[open.back()].offset = {std::stod(words[1]), std::stod(words[2]), std::stod(words[3])};
    } else if (words[0] == "CHANNELS") {
      file.nodes[open.back()].channels.assign(words.begin() + 2, words.end());
    } else if (words[0] == "}") {
      open.pop_back();
    }
  }
  return file;
}

inline Eigen::Matrix4d rotation(char axis, double degrees) {
  const double c = std::cos(degrees * std::numbers::pi / 180.0);
  const double s = std::sin(degrees * std::numbers::pi / 180.0);
  Eigen::Matrix4d m;
  if (axis == 'X') m << 1, 0, 0, 0, 0, c, -s, 0, 0, s, c, 0, 0, 0, 0, 1;
  if (axis == 'Y') m << c, 0, s, 0, 0, 1, 0, 0, -s, 0, c, 0, 0, 0, 0, 1;
  if (axis == 'Z') m << c, -s, 0, 0, s, c, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1;
  return m;
}

/// World position of every node in that frame.
inline std::vector<Eigen::Vector3d> positions(const File& file, int frame) {
  std::vector<Eigen::Matrix4d> world;
  std::vector<Eigen::Vector3d> result;
  std::size_t column = 0;
  for (const Node& node : file.nodes) {
    Eigen::Vector3d place = node.offset;
    Eigen::Matrix4d turn = Eigen::Matrix4d::Identity();
    for (const std::string& channel : node.channels) {
      const double value = file.rows[frame][column++];
      if (channel.substr(1) == "position") place[channel[0] - 'X'] = value;
      else turn = turn * rotation(channel[0], value);
    }
    Eigen::Matrix4d shift = Eigen::Matrix4d::Identity();
    shift(0, 3) = place[0];
    shift(1, 3) = place[1];
    shift(2, 3) = place[2];
    const Eigen::Matrix4d above = node.parent < 0 ? Eigen::Matrix4d::Identity() : world[node.parent];
    world.push_back(above * shift * turn);
    result.push_back({world.back()(0, 3), world.back()(1, 3), world.back()(2, 3)});
  }
  return result;
}

}  // namespace sinew::plain_bvh
