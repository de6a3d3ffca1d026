#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pipeline/solid.h"
#include "pipeline/volume_graph.h"
#include "skeleton/rig_skeleton.h"

namespace sinew {

struct BindingOptions {
  double cylinder_share = 0.6;   ///< cylinder radius as a share of local thickness R
  double sphere_share = 1.1;     ///< joint sphere radius as a share of R ...
  double sphere_bone_cap = 0.45; ///< ... and at most this share of the shortest incident bone
  double trim_share = 1.1;       ///< cylinders end this many R before each joint
  double core_share = 0.25;      ///< thin core radius as a share of R (refined only)
  bool cores = true;             ///< off: the paper's form
  bool twist_fields = true;      ///< off: the paper's form
};

/// A joint that moves part of the body, with the pieces of body that turn with it.
struct Bone {
  int joint = 0;
  std::vector<Segment> segments;   ///< from the joint to each child and to its tip, then its helpers
  bool twists = false;             ///< carries two fields: boundary values 1 - t and t along the cylinder
};

/// One field of the first pass: a bone, or the near or far half of a twisting bone.
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
struct CoreConstraint {
  int node = 0;
  int bone = 0;
  Eigen::Vector3d foot = Eigen::Vector3d::Zero();
};

/// Which nodes each bone holds, and how.
struct Binding {
  std::vector<Bone> bones;
  std::vector<FieldSource> fields;
  std::vector<FieldConstraint> field_constraints;    ///< sorted by node, then field
  std::vector<SphereConstraint> spheres;             ///< sorted by node; a node is held once
  std::vector<CoreConstraint> cores;                 ///< sorted by node; none that is in `spheres`
  /// Components no bone reaches: each node of them follows a bone rigidly (node, bone).
  std::vector<std::pair<int, int>> glued;
  std::vector<std::string> warnings;                 ///< bones without nodes, unbalanced joints, ...
};

/// Chooses the nodes. `volume` gains the axis nodes of thin limbs (appended, linked to what is near).
/// Throws UnusableInput when no bone holds a node. After [Shi et al. 2006, section 7] and the
/// measured additions of docs/method.md.
Binding bind(const TriMesh& mesh, const Solid& solid, const RigSkeleton& skeleton,
             const BindingOptions& options, VolumeGraph& volume);

}  // namespace sinew
