// Writes the sample character, its rig and its two clips: make_samples FOLDER. The files are kept in
// samples/ogre; this program is how they came to be.
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <numbers>
#include <string>

#include "io/rig_file.h"
#include "samples/ogre_mesh.h"
#include "samples/ogre_motion.h"

namespace {

using namespace sinew;

std::string text(const char* format, double a, double b, double c) {
  char buffer[128];
  std::snprintf(buffer, sizeof buffer, format, a, b, c);
  return buffer;
}

void write_obj(std::ostream& out, const samples::ColouredMesh& ogre) {
  out << "# The sample character. Made by tools/make_samples.cpp; metres, y up, facing +z.\no ogre\n";
  for (int vertex = 0; vertex < ogre.mesh.vertex_count(); ++vertex) {
    const auto p = ogre.mesh.positions.row(vertex);
    const auto& c = ogre.colours[vertex];
    out << "v " << text("%.5f %.5f %.5f", p[0], p[1], p[2]) << text(" %.3f %.3f %.3f\n", c[0], c[1], c[2]);
  }
  for (const auto& triangle : ogre.mesh.triangles) {
    out << "f " << triangle[0] + 1 << ' ' << triangle[1] + 1 << ' ' << triangle[2] + 1 << '\n';
  }
}

void write_hierarchy(std::ostream& out, const Skeleton& skeleton, int joint, const std::string& indent) {
  const Eigen::Vector3d offset = skeleton.rest[joint].translation;
  out << indent << (skeleton.parents[joint] < 0 ? "ROOT " : "JOINT ") << skeleton.names[joint] << '\n' << indent << "{\n";
  const std::string inner = indent + "  ";
  out << inner << "OFFSET " << text("%.5f %.5f %.5f\n", offset.x(), offset.y(), offset.z());
  out << inner
      << (skeleton.parents[joint] < 0 ? "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n"
                                      : "CHANNELS 3 Zrotation Xrotation Yrotation\n");
  for (int child = joint + 1; child < skeleton.joint_count(); ++child) {
    if (skeleton.parents[child] == joint) write_hierarchy(out, skeleton, child, inner);
  }
  for (const Eigen::Vector3d& tip : skeleton.tips[joint]) {
    out << inner << "End Site\n" << inner << "{\n" << inner << "  OFFSET " << text("%.5f %.5f %.5f\n", tip.x(), tip.y(), tip.z())
        << inner << "}\n";
  }
  out << indent << "}\n";
}

/// Joints in the order their CHANNELS lines stand in the file.
void in_file_order(const Skeleton& skeleton, int joint, std::vector<int>& order) {
  order.push_back(joint);
  for (int child = joint + 1; child < skeleton.joint_count(); ++child) {
    if (skeleton.parents[child] == joint) in_file_order(skeleton, child, order);
  }
}

void write_bvh(std::ostream& out, const Clip& clip) {
  out << "HIERARCHY\n";
  write_hierarchy(out, clip.skeleton, 0, "");
  std::vector<int> order;
  in_file_order(clip.skeleton, 0, order);
  out << "MOTION\nFrames: " << clip.frame_count << "\nFrame Time: " << text("%.7f\n", 1.0 / clip.frames_per_second, 0, 0);
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  for (int frame = 0; frame < clip.frame_count; ++frame) {
    const auto local = clip.frame(frame);
    for (const int joint : order) {
      const Eigen::Matrix3d R = local[joint].rotation.toRotationMatrix();
      const Eigen::Vector3d& p = local[joint].translation;
      if (joint == 0) out << text("%.5f %.5f %.5f ", p.x(), p.y(), p.z());
      // R = Rz Rx Ry
      out << text("%.4f %.4f %.4f ", kDegrees * std::atan2(-R(0, 1), R(1, 1)), kDegrees * std::asin(R(2, 1)),
                  kDegrees * std::atan2(-R(2, 0), R(2, 2)));
    }
    out << '\n';
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: make_samples FOLDER\n";
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  std::ofstream mesh(folder / "ogre.obj");
  write_obj(mesh, samples::make_ogre());
  std::ofstream rig(folder / "ogre.toml");
  rig << "# Made by tools/make_samples.cpp: where the ogre's joints are.\n" << to_rig_text(samples::ogre_rig());
  std::ofstream walk(folder / "walk.bvh");
  write_bvh(walk, samples::walk_clip());
  std::ofstream wave(folder / "wave.bvh");
  write_bvh(wave, samples::wave_clip());
  return mesh.good() && rig.good() && walk.good() && wave.good() ? 0 : 1;
}
