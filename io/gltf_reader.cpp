// Skins after the glTF 2.0 specification, section 3.7.3; how meshes bind to joints: gltf_bind.h.
#include "io/gltf_reader.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "io/file_error.h"
#include "io/gltf_bind.h"
#include "io/gltf_body.h"
#include "io/gltf_document.h"
#include "io/gltf_tracks.h"
#include "skeleton/roles.h"

namespace sinew {
namespace {

/// Transforms a clip or a motion may hold: two hours of 90 joints at 30 Hz, or 1.6 GB.
constexpr double kMostTransforms = 20e6;

/// Where in its weighted vertices a leaf's bone ends: short of the skin, so that the bone stays inside.
constexpr double kTipShare = 0.8;

/// A vertex counts as a leaf's own from this weight on.
constexpr double kOwnWeight = 0.5;

/// A share of a frame: key times are floats, and 2.0 seconds may be written as 1.9999999.
constexpr double kFrameSlack = 1e-3;

void check_rate(double frames_per_second, const char* who) {
  if (std::isfinite(frames_per_second) && frames_per_second > 0.0) return;
  throw std::invalid_argument(std::string(who) + ": frames_per_second is " +
                              std::to_string(frames_per_second) + "; expected a positive number");
}

/// Frames from 0 to the last one not after `seconds`.
int frame_count(double seconds, double frames_per_second, std::size_t transforms_a_frame,
                const std::string& where) {
  const double frames = std::floor(seconds * frames_per_second + kFrameSlack) + 1.0;
  if (!(frames * static_cast<double>(std::max<std::size_t>(transforms_a_frame, 1)) <= kMostTransforms)) {
    throw FileError(FileFault::resource, where,
                    "lasts " + std::to_string(seconds) + " seconds; too long for " +
                        std::to_string(frames_per_second) + " frames a second of " +
                        std::to_string(transforms_a_frame) + " joints");
  }
  return static_cast<int>(frames);
}

/// Rotations, positions and sizes of the joints relative to the bind pose. A joint flattened to nothing
/// has no rotation of its own and keeps the one before.
class JointReader {
 public:
  JointReader(const GltfBind& bind, const std::vector<int>& joints) : joints_(joints) {
    for (const int node : joints) {
      const Eigen::Affine3d& world = bind.world[node];
      from_bind_.push_back(is_invertible(world)
                               ? Eigen::Matrix3d(world.linear().inverse())
                               : nearest_rotation(world.linear()).conjugate().toRotationMatrix());
    }
    rotations_.assign(joints.size(), Eigen::Quaterniond::Identity());
  }

  Pose read(const std::vector<Eigen::Affine3d>& world) {
    constexpr double kLeastScale = 1e-12;  // a pose's scales are positive
    Pose pose;
    for (std::size_t joint = 0; joint < joints_.size(); ++joint) {
      const Eigen::Affine3d& now = world[joints_[joint]];
      if (is_invertible(now)) rotations_[joint] = nearest_rotation(now.linear() * from_bind_[joint]);
      pose.positions.push_back(now.translation());
      pose.rotations.push_back(rotations_[joint]);
      const double volume = std::abs((now.linear() * from_bind_[joint]).determinant());
      pose.scales.push_back(std::max(kLeastScale, std::cbrt(volume)));
    }
    return pose;
  }

 private:
  const std::vector<int>& joints_;          ///< nodes
  std::vector<Eigen::Matrix3d> from_bind_;  ///< undoes the bind pose's linear part
  std::vector<Eigen::Quaterniond> rotations_;
};

/// Numbers where a name is missing, and a number behind one that was there before: a rig's joints are
/// told apart by name in its file.
class UniqueNames {
 public:
  std::string take(const std::string& name, std::size_t index) {
    const std::string wanted = name.empty() ? "joint_" + std::to_string(index) : name;
    std::string unique = wanted;
    while (copies_.contains(unique)) unique = wanted + "_" + std::to_string(++copies_[wanted]);
    copies_.emplace(unique, 1);
    return unique;
  }

 private:
  std::map<std::string, int> copies_;  ///< how many of each name have been given out
};

/// The skins' joints, but for those that move nothing: neither they nor a node below has vertices.
std::vector<int> moving_joints(const GltfDocument& document, const GltfBind& bind, const GltfBody& body) {
  std::vector<bool> moves(document.nodes.size(), false);
  for (const GltfPart& part : body.parts) {
    if (part.skin < 0) moves[part.node] = true;
    for (std::size_t i = 0; i < part.slots.size(); ++i) {
      if (part.weights[i] > 0.0) moves[document.skins[part.skin].joints[part.slots[i]]] = true;
    }
  }
  for (auto node = document.node_order.rbegin(); node != document.node_order.rend(); ++node) {
    const int parent = document.nodes[*node].parent;
    if (moves[*node] && parent >= 0) moves[parent] = true;
  }
  std::vector<int> joints = bind.joints;
  std::erase_if(joints, [&](int node) { return !moves[node]; });
  return joints.empty() ? bind.joints : joints;  // without a mesh nobody can say what moves
}

/// The bone runs from the joint through the middle of what it moves, to kTipShare of that thing's
/// furthest extent. For a hand, a head or a finger this is the direction in which the bone before it
/// points, for a foot it is not.
std::optional<Eigen::Vector3d> tip_of(const RigJoint& joint, const std::vector<Eigen::Vector3d>& own,
                                      const RigSkeleton& rig) {
  if (own.empty()) return std::nullopt;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  double reach = 0.0;
  for (const Eigen::Vector3d& vertex : own) {
    middle += vertex / static_cast<double>(own.size());
    reach = std::max(reach, (vertex - joint.position).norm());
  }
  Eigen::Vector3d direction = middle - joint.position;
  const bool centred = direction.norm() < 0.1 * reach;  // a ball around the joint has no direction
  if (centred && joint.parent >= 0) direction = joint.position - rig.joints[joint.parent].position;
  if (!(direction.norm() > 1e-9 * reach)) return std::nullopt;
  direction.normalize();
  double extent = 0.0;
  for (const Eigen::Vector3d& vertex : own) extent = std::max(extent, direction.dot(vertex - joint.position));
  return joint.position + kTipShare * extent * direction;
}

/// Where the body looks: left of it is across up and front. To the nearest axis, since the joints of
/// left and right are never quite level. Z, as glTF wants it, where roles do not tell.
Eigen::Vector3d front_of(const RigSkeleton& rig, const RoleMap& roles) {
  const auto joint_of = [&](Role role) { return roles.joint_of_role[static_cast<int>(role)]; };
  const int left = joint_of(Role::left_upper_leg), right = joint_of(Role::right_upper_leg);
  if (left < 0 || right < 0) return Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d across = rig.joints[left].position - rig.joints[right].position;
  const Eigen::Vector3d front = across.cross(rig.up);
  if (std::abs(front.x()) > std::abs(front.z()))
    return std::copysign(1.0, front.x()) * Eigen::Vector3d::UnitX();
  return std::copysign(1.0, front.z()) * Eigen::Vector3d::UnitZ();
}

}  // namespace

struct GltfFile::Members {
  explicit Members(const std::filesystem::path& path);

  GltfDocument document;
  GltfBind bind;
  GltfBody body;
  std::vector<int> joints;         ///< of the rig: nodes, parents before children
  std::vector<int> joint_of_node;  ///< -1 for nodes that are no joints of the rig
  std::vector<int> joint_above;    ///< of every node: the nearest joint among its ancestors, or -1

  int find_animation(const std::string& wanted) const;
  std::vector<std::vector<Eigen::Vector3d>> own_vertices() const;
  void find_tips(RigSkeleton& rig) const;
  int frames_of(const GltfTracks& tracks, int animation, double frames_per_second) const;
};

GltfFile::Members::Members(const std::filesystem::path& path)
    : document(read_gltf_document(path)), bind(read_gltf_bind(document)), body(read_gltf_body(document)) {
  joints = moving_joints(document, bind, body);
  joint_of_node.assign(document.nodes.size(), -1);
  for (std::size_t joint = 0; joint < joints.size(); ++joint)
    joint_of_node[joints[joint]] = static_cast<int>(joint);
  joint_above.assign(document.nodes.size(), -1);
  for (const int node : document.node_order) {
    const int parent = document.nodes[node].parent;
    if (parent >= 0)
      joint_above[node] = joint_of_node[parent] >= 0 ? joint_of_node[parent] : joint_above[parent];
  }
}

int GltfFile::Members::find_animation(const std::string& wanted) const {
  const std::vector<GltfAnimation>& all = document.animations;
  if (all.empty()) throw FileError(FileFault::unusable, document.file, "has no animations");
  if (wanted.empty()) return 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].name == wanted) return static_cast<int>(i);
  }
  const bool number = wanted.size() < 9 && wanted.find_first_not_of("0123456789") == std::string::npos;
  if (number && std::stoul(wanted) < all.size()) return std::stoi(wanted);
  std::string names;
  for (const GltfAnimation& animation : all) names += (names.empty() ? "'" : ", '") + animation.name + "'";
  throw FileError(FileFault::unusable, document.file,
                  "has no animation '" + wanted + "'; expected one of " + names + " or 0 to " +
                      std::to_string(all.size() - 1));
}

/// Per joint, the vertices that follow it alone or nearly. Rigid parts count whole for the joint they
/// hang under.
std::vector<std::vector<Eigen::Vector3d>> GltfFile::Members::own_vertices() const {
  std::vector<std::vector<Eigen::Vector3d>> own(joints.size());
  const Field3 placed = place_vertices(body, document, bind, bind.world);
  int row = 0;
  for (const GltfPart& part : body.parts) {
    const int holder = part.skin < 0 ? joint_above[part.node] : -1;
    for (int vertex = 0; vertex < part.vertex_count(); ++vertex, ++row) {
      if (holder >= 0) own[holder].push_back(placed.row(row));
      for (int i = vertex * part.influences; i < (vertex + 1) * part.influences; ++i) {
        const int joint = joint_of_node[document.skins[part.skin].joints[part.slots[i]]];
        if (part.weights[i] > kOwnWeight && joint >= 0) own[joint].push_back(placed.row(row));
      }
    }
  }
  return own;
}

void GltfFile::Members::find_tips(RigSkeleton& rig) const {
  std::vector<bool> has_child(rig.joints.size(), false);
  for (const RigJoint& joint : rig.joints) {
    if (joint.parent >= 0) has_child[joint.parent] = true;
  }
  const std::vector<std::vector<Eigen::Vector3d>> own = own_vertices();
  for (std::size_t joint = 0; joint < own.size(); ++joint) {
    if (!has_child[joint]) rig.joints[joint].tip = tip_of(rig.joints[joint], own[joint], rig);
  }
}

int GltfFile::Members::frames_of(const GltfTracks& tracks, int animation, double frames_per_second) const {
  return frame_count(tracks.seconds(), frames_per_second, document.nodes.size(),
                     document.where("animations", animation));
}

GltfFile::GltfFile(const std::filesystem::path& path) : members_(std::make_unique<Members>(path)) {}
GltfFile::~GltfFile() = default;
GltfFile::GltfFile(GltfFile&&) noexcept = default;
GltfFile& GltfFile::operator=(GltfFile&&) noexcept = default;

std::vector<GltfSkinSummary> GltfFile::skins() const {
  std::vector<GltfSkinSummary> result;
  for (const GltfSkin& skin : members_->document.skins) {
    result.push_back({skin.name, static_cast<int>(skin.joints.size())});
  }
  return result;
}

std::vector<GltfAnimationSummary> GltfFile::animations() const {
  const GltfDocument& document = members_->document;
  std::vector<GltfAnimationSummary> result;
  for (const GltfAnimation& animation : document.animations) {
    GltfAnimationSummary summary{animation.name, 0.0, static_cast<int>(animation.channels.size()), 0};
    std::set<int> moved;
    for (const GltfChannel& channel : animation.channels) {
      if (channel.path == GltfPath::weights) continue;
      moved.insert(channel.node);
      const int input = animation.samplers[channel.sampler].input;
      summary.seconds = std::max(summary.seconds, read_last_number(document, input));
    }
    summary.joints = static_cast<int>(moved.size());
    result.push_back(std::move(summary));
  }
  return result;
}

MeshAsset GltfFile::mesh() const {
  if (members_->body.parts.empty()) {
    throw FileError(FileFault::unusable, members_->document.file, "the scene has no triangles");
  }
  MeshAsset asset = bind_mesh(members_->body, members_->document, members_->bind);
  weld_and_diagnose(asset);
  return asset;
}

std::optional<RigSkeleton> GltfFile::rig() const {
  const std::vector<int>& joints = members_->joints;
  if (joints.empty()) return std::nullopt;
  RigSkeleton rig;
  rig.mesh = members_->document.path.filename().string();
  UniqueNames names;
  Skeleton named;  // for recognise_roles()
  for (std::size_t joint = 0; joint < joints.size(); ++joint) {
    const int node = joints[joint];
    RigJoint made;
    made.name = names.take(members_->document.nodes[node].name, joint);
    made.parent = members_->joint_above[node];
    made.position = members_->bind.world[node].translation();
    Transform rest;
    rest.translation = made.position;
    if (made.parent >= 0) rest.translation -= rig.joints[made.parent].position;
    named.names.push_back(made.name);
    named.parents.push_back(made.parent);
    named.rest.push_back(rest);
    named.tips.emplace_back();
    rig.joints.push_back(std::move(made));
  }
  const RoleMap roles = recognise_roles(named);
  rig.front = front_of(rig, roles);
  for (int role = 0; role < kRoleCount; ++role) {
    if (roles.joint_of_role[role] >= 0) rig.joints[roles.joint_of_role[role]].role = static_cast<Role>(role);
  }
  members_->find_tips(rig);
  return rig;
}

Clip GltfFile::clip(const std::string& animation, double frames_per_second) const {
  check_rate(frames_per_second, "GltfFile::clip");
  const GltfDocument& document = members_->document;
  const int index = members_->find_animation(animation);
  const GltfTracks tracks(document, index);
  std::vector<int> joint_of_node(document.nodes.size(), -1);
  Clip clip;
  clip.name = document.animations[index].name;
  clip.frames_per_second = frames_per_second;
  clip.warnings = document.warnings;
  clip.warnings.insert(clip.warnings.end(), tracks.warnings().begin(), tracks.warnings().end());
  for (const int node : document.node_order) {
    const int parent = document.nodes[node].parent;
    joint_of_node[node] = clip.skeleton.joint_count();
    clip.skeleton.names.push_back(document.nodes[node].name);
    clip.skeleton.parents.push_back(parent < 0 ? -1 : joint_of_node[parent]);
    clip.skeleton.rest.push_back(document.nodes[node].rest);
    clip.skeleton.tips.emplace_back();
  }
  clip.frame_count = members_->frames_of(tracks, index, frames_per_second);
  clip.local.reserve(document.nodes.size() * clip.frame_count);
  for (int frame = 0; frame < clip.frame_count; ++frame) {
    const std::vector<Transform> local = tracks.locals(frame / frames_per_second);
    for (const int node : document.node_order) clip.local.push_back(local[node]);
  }
  return clip;
}

Motion GltfFile::motion(const std::string& animation, double frames_per_second) const {
  check_rate(frames_per_second, "GltfFile::motion");
  const GltfDocument& document = members_->document;
  const GltfBind& bind = members_->bind;
  if (members_->joints.empty())
    throw FileError(FileFault::unusable, document.file, "has no skin, so no joints to move");
  const int index = members_->find_animation(animation);
  const GltfTracks tracks(document, index);
  Motion motion;
  motion.name = document.animations[index].name;
  motion.frames_per_second = frames_per_second;
  for (const auto* warnings : {&document.warnings, &bind.warnings, &tracks.warnings()}) {
    motion.warnings.insert(motion.warnings.end(), warnings->begin(), warnings->end());
  }
  const int frames = members_->frames_of(tracks, index, frames_per_second);
  JointReader joints(bind, members_->joints);
  for (int frame = 0; frame < frames; ++frame) {
    motion.poses.push_back(joints.read(tracks.worlds(frame / frames_per_second)));
    for (const Eigen::Vector3d& position : motion.poses.back().positions) {
      if (position.allFinite()) continue;
      throw FileError(FileFault::malformed, document.where("animations", index),
                      "a joint of frame " + std::to_string(frame) + " is not finite");
    }
  }
  std::vector<int> parents;
  for (const int node : members_->joints) parents.push_back(members_->joint_above[node]);
  make_continuous(motion.poses, parents);
  return motion;
}

Field3 GltfFile::skinned_positions(const std::string& animation, double seconds) const {
  if (!std::isfinite(seconds))
    throw std::invalid_argument("GltfFile::skinned_positions: seconds is not finite");
  const GltfTracks tracks(members_->document, members_->find_animation(animation));
  return place_vertices(members_->body, members_->document, members_->bind, tracks.worlds(seconds));
}

}  // namespace sinew
