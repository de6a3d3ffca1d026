#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pipeline/solid.h"
#include "pipeline/volume_graph.h"
#include "skeleton/rig_skeleton.h"

namespace sinew {

/// How bone motion becomes body shape.
enum class Deform {
  refined,  ///< thin cores, twist fields, two local/global iterations, accumulated volume scale
  paper,    ///< [Shi et al. 2006, section 7] as published
};

/// Local thickness R of a bone is the distance from its axis to the surface, zero where the axis is
/// outside the body.
struct BindingOptions {
  double cylinder_share = 0.6;   ///< cylinder radius as a share of local thickness R
  double sphere_share = 1.1;     ///< joint sphere radius as a share of R ...
  double sphere_bone_cap = 0.45; ///< ... and at most this share of the shortest incident bone
  double trim_share = 1.1;       ///< cylinders end this many R before each joint
  double core_share = 0.25;      ///< thin core radius as a share of R (refined only)
  bool cores = true;             ///< off: the paper's form
  bool twist_fields = true;      ///< off: the paper's form
};

/// The defaults for one of the two forms. A rig is built for a form, because cores and twist fields
/// decide which nodes are constrained.
BindingOptions binding_options(Deform deform);

/// A joint that moves part of the body, with the pieces of body that turn with it.
struct Bone {
  int joint = 0;
  std::vector<Segment> segments;   ///< from the joint to each child and to its tip, then its helpers
  bool twists = false;             ///< carries two fields: boundary values 1 - t and t along the cylinder
  /// Unit, at rest, along the segment that twists; zero unless `twists`.
  Eigen::Vector3d axis = Eigen::Vector3d::Zero();
  /// Joint whose own twist about `axis` the far field takes too (the hand of a forearm), or -1.
  int twisted_by = -1;
};

/// One field of the first pass: a bone, or the near or far half of a twisting bone. The far half
/// comes right after the near one.
struct FieldSource {
  int bone = 0;
  bool far_end = false;  ///< the half that takes the twist; false for an undivided bone
};

/// Boundary value of the first pass: `node` listens to `field` with `value`. The values of a node sum to one.
struct FieldConstraint {
  int node = 0;
  int field = 0;
  double value = 1.0;
};

/// Position constraint of a joint sphere: x = p_joint + R_node (x0 - p0_joint).
struct SphereConstraint {
  int node = 0;
  int joint = 0;
};

/// Position constraint of a bone's thin core: x = p + G (c - J) + R_node (x0 - c), c the foot on the axis.
/// Where the pose carries the far joint of the segment elsewhere than the bone's rotation would, the
/// foot takes its share `along` of the difference.
struct CoreConstraint {
  int node = 0;
  int bone = 0;
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
  int end_joint = -1;   ///< joint at the segment's far end; -1 at a tip or a helper
  double along = 0.0;   ///< place of the foot on the segment: 0 at the bone's joint, 1 at its end
};

/// Which nodes each bone holds, and how.
struct Binding {
  std::vector<Bone> bones;
  std::vector<FieldSource> fields;
  std::vector<FieldConstraint> field_constraints;    ///< sorted by node, then field
  std::vector<SphereConstraint> spheres;             ///< sorted by node; a node is held once
  std::vector<CoreConstraint> cores;                 ///< sorted by node; they run up to the joints, none is in `spheres`
  /// Components no bone reaches: each node of them follows a bone rigidly (node, bone), sorted by
  /// node. None of them is in the lists above.
  std::vector<std::pair<int, int>> glued;
  std::vector<std::string> warnings;                 ///< bones without nodes, joints without nodes, glued parts
};

/// Chooses the nodes.
///
/// Bones: joints with a segment of some length. Twisting bones: the joints with the role of an upper
/// arm, a lower arm or an upper leg; a rig without roles has none. Only interior nodes are held (a
/// constrained surface shows), and only those that see their bone in a straight line inside the
/// body; so are the nodes on the axis of thin limbs and helpers, which `volume` gains: appended, and
/// linked to what is near. Without interior (Interior::none) every bone gets such axis nodes.
/// A node in reach of several bones goes to the one it is nearest to in units of that bone's radius.
///
/// Throws UnusableInput when no bone holds a node, std::invalid_argument when the rig is not valid.
/// Linear in nodes times segments. After [Shi et al. 2006, section 7] and [Zhou et al. 2005], with
/// additions measured on real clips: thin cores, twist fields, axis nodes, trimming.
Binding bind(const TriMesh& mesh, const Solid& solid, const RigSkeleton& skeleton,
             const BindingOptions& options, VolumeGraph& volume);

/// Lattice constant for a body with these bones: nearest nodes 1.25 mean surface edges apart, or less
/// where the thinnest limb needs it for three of them across. Limbs thinner than the node budget allows do not
/// count: they get axis nodes. The budget is the larger of 100,000 and 8 interior nodes a surface
/// vertex.
double recommended_spacing(const TriMesh& mesh, const Solid& solid, const RigSkeleton& skeleton,
                           const BindingOptions& options);

}  // namespace sinew
