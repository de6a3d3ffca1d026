// Which nodes each bone turns and which each joint holds: [Shi et al. 2006, section 7] in a volume
// graph after [Zhou et al. 2005]. Cores, twist fields and axis nodes are additions of this project.
#include "pipeline/binding.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include "pipeline/axis_nodes.h"
#include "pipeline/bone_regions.h"
#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

constexpr double kNoHold = std::numeric_limits<double>::infinity();

/// Who holds a node: a segment or a joint, and how near it is in units of the holder's radius.
struct Hold {
  int holder = -1;
  double nearness = kNoHold;
  double along = 0.0;  ///< of the foot on the segment

  void offer(int other, double other_nearness, double other_along = 0.0) {
    if (other_nearness < nearness) *this = {other, other_nearness, other_along};
  }
  void release() { *this = {}; }
};

/// One hold per interior node; the surface, never held, is left out.
struct Holds {
  int first_node = 0;
  std::vector<Hold> of_interior;

  explicit Holds(const VolumeGraph& volume)
      : first_node(volume.surface_count), of_interior(volume.node_count() - volume.surface_count) {}
  int node_count() const { return first_node + static_cast<int>(of_interior.size()); }
  Hold& operator[](int node) { return of_interior[node - first_node]; }
  const Hold& operator[](int node) const { return of_interior[node - first_node]; }
  bool holds(int node) const { return node >= first_node && (*this)[node].holder >= 0; }
};

Eigen::Vector3d rest_position(const VolumeGraph& volume, int node) {
  return volume.rest_positions.row(node).transpose();
}

/// Whether `node` sees `target` inside the body. Within the ball of radius `thickness` round the
/// target there is no surface to cross, so the ray is spared.
bool sees(const Solid& solid, const Eigen::Vector3d& position, const Eigen::Vector3d& target, double distance,
          double thickness) {
  constexpr double safe = 0.9;  // thickness is interpolated
  return distance < safe * thickness || !solid.crosses(position, target);
}

/// Offers every interior node that lies within `radius` of the axis, between two places on it.
template <typename Radius>
void offer_segment(const Solid& solid, const VolumeGraph& volume, const BoneSegment& segment, int index,
                   double begin, double end, const Radius& radius, Holds& holds) {
  for (int node = volume.surface_count; node < volume.node_count(); ++node) {
    const Eigen::Vector3d position = rest_position(volume, node);
    const Foot foot = foot_on(segment.axis, position);
    if (foot.along < begin || foot.along > end) continue;
    const double reach = radius(foot.along);
    if (!(reach > 0.0) || foot.distance > reach) continue;
    const double thickness = segment.thickness.at(foot.along);
    if (!sees(solid, position, point_on(segment.axis, foot.along), foot.distance, thickness)) continue;
    holds[node].offer(index, foot.distance / reach, foot.along);
  }
}

/// Lets go of nodes joined by an edge to a node of a bone that shares no joint with theirs, the one
/// farther from its own axis first: two limbs never hold each other.
void release_touching(const VolumeGraph& volume, const RigSkeleton& skeleton, const BoneRegions& regions,
                      Holds& holds) {
  std::vector<int> released;
  for (int node = volume.surface_count; node < volume.node_count(); ++node) {
    if (!holds.holds(node)) continue;
    const Bone& own = regions.bones[regions.segments[holds[node].holder].bone];
    for (const int other : volume.graph.neighbors_of(node)) {
      if (!holds.holds(other)) continue;
      const Bone& theirs = regions.bones[regions.segments[holds[other].holder].bone];
      if (holds[node].nearness < holds[other].nearness || are_adjacent(skeleton, own, theirs)) continue;
      released.push_back(node);
      break;
    }
  }
  for (const int node : released) holds[node].release();
}

Holds cylinder_holds(const Solid& solid, const RigSkeleton& skeleton, const BoneRegions& regions,
                     const VolumeGraph& volume) {
  Holds holds(volume);
  for (int k = 0; k < static_cast<int>(regions.segments.size()); ++k) {
    const BoneSegment& segment = regions.segments[k];
    offer_segment(solid, volume, segment, k, segment.cylinder_begin, segment.cylinder_end,
                  [&](double along) { return segment.cylinder_radius(along); }, holds);
  }
  release_touching(volume, skeleton, regions, holds);
  return holds;
}

Holds sphere_holds(const Solid& solid, const RigSkeleton& skeleton, const BoneRegions& regions,
                   const VolumeGraph& volume) {
  Holds holds(volume);
  for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
    const double radius = regions.sphere_radius[joint];
    if (!(radius > 0.0)) continue;
    const Eigen::Vector3d& center = skeleton.joints[joint].position;
    for (int node = volume.surface_count; node < volume.node_count(); ++node) {
      const Eigen::Vector3d position = rest_position(volume, node);
      const double distance = (position - center).norm();
      if (distance > radius) continue;
      if (!sees(solid, position, center, distance, regions.joint_thickness[joint])) continue;
      holds[node].offer(joint, distance / radius);
    }
  }
  return holds;
}

Holds core_holds(const Solid& solid, const BoneRegions& regions, double share, const VolumeGraph& volume) {
  Holds holds(volume);
  for (int k = 0; k < static_cast<int>(regions.segments.size()); ++k) {
    const BoneSegment& segment = regions.segments[k];
    offer_segment(solid, volume, segment, k, 0.0, 1.0,
                  [&](double along) { return share * segment.thickness.at(along); }, holds);
  }
  return holds;
}

/// Field of each bone: its only one, or its near one.
std::vector<int> add_fields(Binding& binding) {
  std::vector<int> first_field;
  for (int bone = 0; bone < static_cast<int>(binding.bones.size()); ++bone) {
    first_field.push_back(static_cast<int>(binding.fields.size()));
    binding.fields.push_back({bone, false});
    if (binding.bones[bone].twists) binding.fields.push_back({bone, true});
  }
  return first_field;
}

/// Where a node of a twisting bone stands between the near and the far end of its cylinder.
double twist_share(const BoneRegions& regions, const BoneSegment& held_by, const Eigen::Vector3d& foot) {
  const BoneSegment* main = nullptr;
  const Bone& bone = regions.bones[held_by.bone];
  for (const BoneSegment& segment : regions.segments) {
    const bool along_axis = (segment.axis.to - segment.axis.from).normalized().isApprox(bone.axis);
    if (segment.bone == held_by.bone && !segment.helper && along_axis) main = &segment;
  }
  // Over the whole bone, not the trimmed cylinder: the twist then has all of the limb to spread over.
  return std::clamp(foot_on(main->axis, foot).along, 0.0, 1.0);
}

void add_field_constraints(const BoneRegions& regions, const Holds& holds, Binding& binding) {
  const std::vector<int> first_field = add_fields(binding);
  for (int node = holds.first_node; node < holds.node_count(); ++node) {
    if (!holds.holds(node)) continue;
    const BoneSegment& segment = regions.segments[holds[node].holder];
    const int field = first_field[segment.bone];
    if (!binding.bones[segment.bone].twists) {
      binding.field_constraints.push_back({node, field, 1.0});
      continue;
    }
    const double far = twist_share(regions, segment, point_on(segment.axis, holds[node].along));
    binding.field_constraints.push_back({node, field, 1.0 - far});
    binding.field_constraints.push_back({node, field + 1, far});
  }
}

void add_position_constraints(const BoneRegions& regions, const Holds& spheres, const Holds* cores,
                              Binding& binding) {
  for (int node = spheres.first_node; node < spheres.node_count(); ++node) {
    // Cores run up to the joints: inside a sphere a node near the axis would swing with the blended
    // rotation and bend the bone's end.
    if (cores != nullptr && cores->holds(node)) {
      const Hold& hold = (*cores)[node];
      const BoneSegment& segment = regions.segments[hold.holder];
      binding.cores.push_back({node, segment.bone, point_on(segment.axis, hold.along), segment.end_joint, hold.along});
    } else if (spheres.holds(node)) {
      binding.spheres.push_back({node, spheres[node].holder});
    }
  }
}

int nearest_bone(const BoneRegions& regions, const Eigen::Vector3d& point) {
  int bone = -1;
  double nearest = kNoHold;
  for (const BoneSegment& segment : regions.segments) {
    const double distance = clamped_foot_on(segment.axis, point).distance;
    if (distance < nearest) {
      nearest = distance;
      bone = segment.bone;
    }
  }
  return bone;
}

/// Components that lack a turned or a held node would make a system singular.
std::vector<bool> unheld_components(const Binding& binding, const Components& components) {
  std::vector<bool> turned(components.count, false);
  std::vector<bool> held(components.count, false);
  for (const FieldConstraint& constraint : binding.field_constraints) turned[components.component[constraint.node]] = true;
  for (const SphereConstraint& constraint : binding.spheres) held[components.component[constraint.node]] = true;
  for (const CoreConstraint& constraint : binding.cores) held[components.component[constraint.node]] = true;
  std::vector<bool> unheld(components.count);
  for (int k = 0; k < components.count; ++k) unheld[k] = !turned[k] || !held[k];
  return unheld;
}

struct Part {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  int nodes = 0;
  int bone = -1;
};

std::string name_of(const RigSkeleton& skeleton, const Bone& bone) {
  return "'" + skeleton.joints[bone.joint].name + "'";
}

void warn_of_glued_parts(const RigSkeleton& skeleton, const std::vector<Part>& parts, Binding& binding) {
  for (int bone = 0; bone < static_cast<int>(binding.bones.size()); ++bone) {
    int count = 0;
    int nodes = 0;
    for (const Part& part : parts) {
      if (part.bone != bone) continue;
      ++count;
      nodes += part.nodes;
    }
    if (count == 0) continue;
    binding.warnings.push_back("W_PART_GLUED: " + std::to_string(count) + (count == 1 ? " part" : " parts") +
                               " of the body (" + std::to_string(nodes) + " nodes) hold no bone; " +
                               (count == 1 ? "it follows " : "they follow ") + name_of(skeleton, binding.bones[bone]) +
                               " rigidly");
  }
}

void glue_unheld_parts(const RigSkeleton& skeleton, const BoneRegions& regions, const VolumeGraph& volume,
                       Binding& binding) {
  const Components components = connected_components(volume.graph);
  const std::vector<bool> unheld = unheld_components(binding, components);
  std::vector<Part> parts(components.count);
  for (int node = 0; node < volume.node_count(); ++node) {
    Part& part = parts[components.component[node]];
    part.middle += rest_position(volume, node);
    ++part.nodes;
  }
  for (int k = 0; k < components.count; ++k) {
    if (unheld[k]) parts[k].bone = nearest_bone(regions, parts[k].middle / parts[k].nodes);
  }
  for (int node = 0; node < volume.node_count(); ++node) {
    const int bone = parts[components.component[node]].bone;
    if (bone >= 0) binding.glued.emplace_back(node, bone);
  }
  const auto is_glued = [&](const auto& constraint) { return unheld[components.component[constraint.node]]; };
  std::erase_if(binding.field_constraints, is_glued);
  std::erase_if(binding.spheres, is_glued);
  std::erase_if(binding.cores, is_glued);
  warn_of_glued_parts(skeleton, parts, binding);
}

void warn_of_bones(const RigSkeleton& skeleton, const BoneRegions& regions, Binding& binding) {
  std::vector<bool> has_nodes(binding.bones.size(), false);
  for (const FieldConstraint& constraint : binding.field_constraints) {
    has_nodes[binding.fields[constraint.field].bone] = true;
  }
  for (std::size_t bone = 0; bone < binding.bones.size(); ++bone) {
    if (has_nodes[bone]) continue;
    binding.warnings.push_back("W_BONE_EMPTY: bone " + name_of(skeleton, binding.bones[bone]) +
                               " holds no node of the body, so nothing turns with it");
  }
  for (const BoneSegment& segment : regions.segments) {
    constexpr double enough = 0.5;
    if (segment.helper || segment.thickness.inside_share >= enough) continue;
    const int outside = static_cast<int>(std::lround(100.0 * (1.0 - segment.thickness.inside_share)));
    binding.warnings.push_back("W_BONE_OUTSIDE: " + std::to_string(outside) + " % of bone " +
                               name_of(skeleton, binding.bones[segment.bone]) + " lies outside the body");
  }
}

void warn_of_joints(const RigSkeleton& skeleton, const Holds& spheres, Binding& binding) {
  std::vector<bool> has_nodes(skeleton.joints.size(), false);
  for (const SphereConstraint& constraint : binding.spheres) has_nodes[constraint.joint] = true;
  // Where bones are short and the body is thick, a joint's sphere lies within the cores: they hold its place.
  for (const CoreConstraint& constraint : binding.cores) {
    if (spheres.holds(constraint.node)) has_nodes[spheres[constraint.node].holder] = true;
  }
  for (int joint = 0; joint < skeleton.joint_count(); ++joint) {
    if (has_nodes[joint]) continue;
    binding.warnings.push_back("W_JOINT_EMPTY: joint '" + skeleton.joints[joint].name +
                               "' holds no node of the body, so nothing keeps its place");
  }
}

/// A body-centred cubic lattice has two nodes a cell.
double spacing_for_budget(double volume, double nodes) { return std::cbrt(2.0 * volume / nodes); }

double body_volume(const TriMesh& mesh) {
  // An open surface may enclose next to nothing by the divergence theorem; no body of interest fills
  // less than a hundredth of its box.
  const BoundingBox box = bounds(mesh);
  return std::max(std::abs(enclosed_volume(mesh, mesh.positions)), 0.01 * (box.high - box.low).prod());
}

/// Least thickness in the cylinder. A tip lies at the surface, where every limb is thin, so of a
/// segment that ends in one the half towards the joint counts.
double thinnest(const BoneSegment& segment) {
  const double begin = segment.cylinder_begin;
  const double end = segment.end_joint >= 0 ? segment.cylinder_end : 0.5 * (begin + segment.cylinder_end);
  double least = segment.thickness.at(begin);
  constexpr int steps = 32;
  for (int step = 1; step <= steps; ++step) {
    least = std::min(least, segment.thickness.at(begin + (end - begin) * step / steps));
  }
  return least;
}

}  // namespace

BindingOptions binding_options(Deform deform) {
  BindingOptions options;
  options.cores = options.twist_fields = deform == Deform::refined;
  return options;
}

Binding bind(const TriMesh& mesh, const Solid& solid, const RigSkeleton& skeleton, const BindingOptions& options,
             VolumeGraph& volume) {
  BoneRegions regions = bone_regions(solid, skeleton, options);
  const double spacing = volume.spacing > 0.0 ? volume.spacing : mean_edge_length(mesh);
  keep_apart(solid, skeleton, spacing, regions);
  add_axis_nodes(solid, regions, thin_segments(regions, volume, options), volume);

  Binding binding;
  binding.bones = regions.bones;
  add_field_constraints(regions, cylinder_holds(solid, skeleton, regions, volume), binding);
  const Holds spheres = sphere_holds(solid, skeleton, regions, volume);
  const Holds cores = core_holds(solid, regions, options.cores ? options.core_share : 0.0, volume);
  add_position_constraints(regions, spheres, options.cores ? &cores : nullptr, binding);
  glue_unheld_parts(skeleton, regions, volume, binding);
  if (binding.field_constraints.empty()) {
    throw UnusableInput("no bone of the rig holds any part of the mesh; move its joints inside the mesh");
  }
  warn_of_bones(skeleton, regions, binding);
  warn_of_joints(skeleton, spheres, binding);
  return binding;
}

double recommended_spacing(const TriMesh& mesh, const Solid& solid, const RigSkeleton& skeleton,
                           const BindingOptions& options) {
  constexpr double edges_per_step = 1.25;
  constexpr double steps_per_limb = 3.0;
  // A step between nearest nodes of a body-centred cubic lattice is half the cell's space diagonal.
  const double spacing_per_step = 2.0 / std::sqrt(3.0);
  const double budget = std::max(100'000.0, 8.0 * mesh.vertex_count());
  const double finest = spacing_for_budget(body_volume(mesh), budget);
  double spacing = spacing_per_step * edges_per_step * mean_edge_length(mesh);
  for (const BoneSegment& segment : bone_regions(solid, skeleton, options).segments) {
    const double wanted = spacing_per_step * 2.0 * thinnest(segment) / steps_per_limb;
    if (wanted >= finest) spacing = std::min(spacing, wanted);
  }
  return std::max(spacing, finest);
}

}  // namespace sinew
