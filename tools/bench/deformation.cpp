// bench_deformation MESH RIG CLIP...: how well each way of deforming keeps a body's shape.
//
// Two tables: test poses (local volume round the joint / largest edge stretch / folded edges, bone drift),
// and clips (volume median and least, stretch 99th percentile and largest, self-intersecting pairs over the
// rest pose's, median and most).
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "io/bvh.h"
#include "io/mesh_asset.h"
#include "io/obj_writer.h"
#include "io/rig_file.h"
#include "pipeline/animate.h"
#include "pipeline/quality.h"
#include "pipeline/skinning.h"
#include "skeleton/retarget.h"

namespace {

using namespace sinew;
using nlohmann::json;

constexpr double kDegree = std::numbers::pi / 180.0;

struct BenchOptions {
  std::filesystem::path mesh;
  std::filesystem::path rig;
  std::vector<std::filesystem::path> clips;
  std::filesystem::path json_file;
  std::filesystem::path objects;  ///< folder for the test poses as OBJ
  int frames = 50;                ///< per clip, evenly spread
  int threads = 2;
  double spacing = 0.0;
  double volume_gain = 0.7;
  int local_global = 2;
};

struct TestPose {
  std::string name;
  Role joint;          ///< turned, and measured round
  Role along;          ///< its child in the limb: gives the direction that turns
  enum { forward, backward, down, twist } way;
  double degrees;
};

const std::vector<TestPose> kTestPoses = {
    {"elbow 120", Role::left_lower_arm, Role::left_hand, TestPose::forward, 120},
    {"wrist twist 150", Role::left_hand, Role::left_lower_arm, TestPose::twist, 150},
    {"arm down 80", Role::left_upper_arm, Role::left_lower_arm, TestPose::down, 80},
    {"knee 120", Role::left_lower_leg, Role::left_foot, TestPose::backward, 120},
    {"hip 100", Role::left_upper_leg, Role::left_lower_leg, TestPose::forward, 100},
};

enum class Way { paper, refined, linear_skinning, dual_quaternions };
constexpr std::array<Way, 4> kWays = {Way::paper, Way::refined, Way::linear_skinning, Way::dual_quaternions};
const char* name_of(Way way) {
  constexpr std::array<const char*, 4> names = {"paper", "refined", "LBS", "DQS"};
  return names[static_cast<int>(way)];
}

int joint_with(const RigSkeleton& rig, Role role) {
  for (int joint = 0; joint < rig.joint_count(); ++joint) {
    if (rig.joints[joint].role == role) return joint;
  }
  throw std::runtime_error("the rig has no joint with the role " + std::string(role_name(role)));
}

/// The rest pose with one joint turned, its descendants carried along.
Pose turned_pose(const RigSkeleton& rig, int turned, const Eigen::Quaterniond& turn) {
  Pose pose = rest_pose(rig);
  for (int joint = 0; joint < rig.joint_count(); ++joint) {
    const int parent = rig.joints[joint].parent;
    if (parent >= 0) {
      const Eigen::Vector3d arm = rig.joints[joint].position - rig.joints[parent].position;
      pose.rotations[joint] = pose.rotations[parent];
      pose.positions[joint] = pose.positions[parent] + pose.rotations[parent] * arm;
    }
    if (joint == turned) pose.rotations[joint] = pose.rotations[joint] * turn;
  }
  return pose;
}

Pose pose_for(const RigSkeleton& rig, const TestPose& test) {
  const int joint = joint_with(rig, test.joint);
  const Eigen::Vector3d limb =
      (rig.joints[joint_with(rig, test.along)].position - rig.joints[joint].position).normalized();
  Eigen::Vector3d axis = limb;
  if (test.way == TestPose::forward) axis = limb.cross(rig.front);
  if (test.way == TestPose::backward) axis = limb.cross(-rig.front);
  if (test.way == TestPose::down) axis = limb.cross(-rig.up);
  return turned_pose(rig, joint, Eigen::Quaterniond(Eigen::AngleAxisd(test.degrees * kDegree, axis.normalized())));
}

/// One way of deforming, ready for poses.
class Deformer {
 public:
  Deformer(Way way, const Rig& rig, const BenchOptions& options, ThreadTeam& team) : way_(way), rig_(rig) {
    FrameOptions frame;
    frame.deform = way == Way::paper ? Deform::paper : Deform::refined;
    frame.tolerance = 1e-6;
    frame.start = Start::zero;
    frame.volume_gain = options.volume_gain;
    frame.local_global = options.local_global;
    solver_ = std::make_unique<FrameSolver>(rig, frame, team);
  }
  void deform(const Pose& pose, Field3& positions) {
    if (way_ == Way::linear_skinning) return linear_blend_skinning(rig_, pose, positions);
    if (way_ == Way::dual_quaternions) return dual_quaternion_skinning(rig_, pose, positions);
    solver_->solve(pose);
    solver_->read_positions(positions);
  }

 private:
  Way way_;
  const Rig& rig_;
  std::unique_ptr<FrameSolver> solver_;
};

struct ClipQuality {
  std::vector<double> volume, percentile_99, largest, intersections, drift, farthest;
};

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values.empty() ? 0.0 : values[values.size() / 2];
}
double least(const std::vector<double>& values) { return *std::min_element(values.begin(), values.end()); }
double most(const std::vector<double>& values) { return *std::max_element(values.begin(), values.end()); }

json measure_poses(Deformer& deformer, const Rig& rig, const QualityMeter& meter, const MeshAsset& asset, Way way,
                   const BenchOptions& options) {
  json rows = json::array();
  Field3 positions = rig.volume.rest_positions;
  for (const TestPose& test : kTestPoses) {
    const Pose pose = pose_for(rig.skeleton, test);
    deformer.deform(pose, positions);
    const int joint = joint_with(rig.skeleton, test.joint);
    const EdgeStretch stretch = meter.edge_stretch(positions);
    rows.push_back({{"pose", test.name},
                    {"local_volume", meter.local_volume_ratio(joint, positions)},
                    {"least_stretch", stretch.least},
                    {"largest_stretch", stretch.largest},
                    {"percentile_99", stretch.percentile_99},
                    {"folded_edges", meter.folded_edges(positions)},
                    {"bone_drift", meter.bone_drift(pose, positions)},
                    {"volume", meter.volume_ratio(positions)},
                    {"self_intersections", meter.self_intersections(positions)}});
    if (!options.objects.empty()) {
      std::string file = test.name + "-" + name_of(way) + ".obj";
      std::replace(file.begin(), file.end(), ' ', '-');
      write_obj(options.objects / file, asset, positions.topRows(rig.mesh.vertex_count()));
    }
  }
  return rows;
}

json measure_clip(Deformer& deformer, const Rig& rig, const QualityMeter& meter, const Motion& motion, int frames) {
  ClipQuality quality;
  Field3 positions = rig.volume.rest_positions;
  const int rest_intersections = meter.self_intersections(rig.mesh.positions);
  for (int k = 0; k < frames; ++k) {
    const int frame = static_cast<int>(static_cast<std::int64_t>(k) * (motion.frame_count() - 1) / std::max(1, frames - 1));
    deformer.deform(motion.poses[frame], positions);
    const EdgeStretch stretch = meter.edge_stretch(positions);
    quality.volume.push_back(meter.volume_ratio(positions));
    quality.percentile_99.push_back(stretch.percentile_99);
    quality.largest.push_back(stretch.largest);
    quality.intersections.push_back(meter.self_intersections(positions) - rest_intersections);
    quality.drift.push_back(meter.bone_drift(motion.poses[frame], positions));
  }
  return {{"clip", motion.name},
          {"volume_median", median(quality.volume)},
          {"volume_least", least(quality.volume)},
          {"percentile_99", median(quality.percentile_99)},
          {"largest_stretch", most(quality.largest)},
          {"self_intersections_median", median(quality.intersections)},
          {"self_intersections_most", most(quality.intersections)},
          {"bone_drift_most", most(quality.drift)}};
}

void print_poses(const json& ways) {
  std::printf("%-18s", "local volume / largest stretch / folds / drift R / pairs");
  std::printf("\n");
  for (std::size_t row = 0; row < kTestPoses.size(); ++row) {
    std::printf("%-16s", kTestPoses[row].name.c_str());
    for (const json& way : ways) {
      const json& cell = way["poses"][row];
      std::printf("  %-7s %.2f/%.2f-%.2f/%d/%.2f/%d", way["way"].get<std::string>().c_str(), cell["local_volume"].get<double>(),
                  cell["least_stretch"].get<double>(), cell["largest_stretch"].get<double>(), cell["folded_edges"].get<int>(),
                  cell["bone_drift"].get<double>(), cell["self_intersections"].get<int>());
    }
    std::printf("\n");
  }
}

void print_clips(const json& ways, std::size_t clip_count) {
  for (std::size_t row = 0; row < clip_count; ++row) {
    std::printf("%-16s", ways[0]["clips"][row]["clip"].get<std::string>().c_str());
    for (const json& way : ways) {
      const json& cell = way["clips"][row];
      std::printf("  %-7s %.3f/%.3f %.2f %.2f %d/%d d%.2f", way["way"].get<std::string>().c_str(),
                  cell["volume_median"].get<double>(), cell["volume_least"].get<double>(), cell["percentile_99"].get<double>(),
                  cell["largest_stretch"].get<double>(), static_cast<int>(cell["self_intersections_median"].get<double>()),
                  static_cast<int>(cell["self_intersections_most"].get<double>()), cell["bone_drift_most"].get<double>());
    }
    std::printf("\n");
  }
}

void run(const BenchOptions& options) {
  const MeshAsset asset = read_mesh(options.mesh);
  const RigSkeleton skeleton = read_rig(options.rig);
  ThreadTeam team(options.threads);
  std::vector<Motion> motions;
  for (const auto& clip : options.clips) {
    motions.push_back(retarget(read_bvh(clip), skeleton));
    motions.back().name = clip.stem().string();
  }
  json ways = json::array();
  for (const Deform form : {Deform::paper, Deform::refined}) {
    RigOptions rig_options;
    rig_options.binding = binding_options(form);
    rig_options.volume.spacing = options.spacing;
    rig_options.solver = SolverKind::cholesky;  // what is measured is the form, not the solver
    const Rig rig = build_rig(asset.mesh, skeleton, rig_options, team);
    std::fprintf(stderr, "%d nodes, %d free, spacing %.4f\n", rig.volume.node_count(),
                 static_cast<int>(rig.node_of_free.size()), rig.volume.spacing);
    for (const std::string& warning : rig.warnings) std::fprintf(stderr, "%s\n", warning.c_str());
    const QualityMeter meter(rig);
    for (const Way way : kWays) {
      // Skinning takes the weights of the paper's rig: one field a bone.
      if ((way == Way::refined) != (form == Deform::refined)) continue;
      Deformer deformer(way, rig, options, team);
      json entry = {{"way", name_of(way)}, {"poses", measure_poses(deformer, rig, meter, asset, way, options)}};
      entry["clips"] = json::array();
      for (const Motion& motion : motions) {
        entry["clips"].push_back(measure_clip(deformer, rig, meter, motion, options.frames));
      }
      ways.push_back(std::move(entry));
    }
  }
  print_poses(ways);
  print_clips(ways, motions.size());
  if (!options.json_file.empty()) std::ofstream(options.json_file) << ways.dump(2) << '\n';
}

}  // namespace

int main(int argc, char** argv) try {
  BenchOptions options;
  CLI::App app("Compares ways of deforming a body: test poses and clips.");
  app.add_option("mesh", options.mesh, "mesh file")->required();
  app.add_option("rig", options.rig, "rig file made for it")->required();
  app.add_option("clips", options.clips, "BVH files");
  app.add_option("--json", options.json_file, "write every number here");
  app.add_option("--objects", options.objects, "write the test poses into this folder as OBJ");
  app.add_option("--frames", options.frames, "frames per clip, evenly spread")->check(CLI::PositiveNumber);
  app.add_option("--threads", options.threads);
  app.add_option("--spacing", options.spacing, "lattice constant; 0: as recommended");
  app.add_option("--volume-gain", options.volume_gain, "gamma of the volume scale");
  app.add_option("--local-global", options.local_global, "iterations of the refined form");
  CLI11_PARSE(app, argc, argv);
  run(options);
} catch (const std::exception& error) {
  std::fprintf(stderr, "bench_deformation: %s\n", error.what());
  return 1;
}
