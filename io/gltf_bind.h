#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "io/gltf_document.h"

namespace sinew {

/// Where every node stands in the bind pose: the pose in which the skins leave their meshes as they are.
///
/// A skin says that at bind, world(joint) * inverse_bind(joint) is one and the same matrix B for all its
/// joints, but not which: B takes the mesh into the scene. It is read off the skin's topmost joint,
/// taken to stand at bind where the file's node puts it, so world(joint) at bind = B * inverse_bind^-1.
/// Where the nodes are visibly not in the bind pose, that joint may be turned too; then the place of
/// the mesh's own node is taken if it is a likely B (same size, turned by less than 45 degrees), since
/// most exporters leave the node there. Skins that share joints are tied together by the first joint
/// they share. All other nodes follow their parents.
struct GltfBind {
  std::vector<int> skins;              ///< drawn ones; all of the file's when none is drawn
  std::vector<int> joints;             ///< nodes, each once, parents before children
  std::vector<Eigen::Affine3d> world;  ///< of every node, at bind
  std::vector<std::vector<Eigen::Affine3d>> inverse_bind;  ///< per skin of the file, per entry of its joints
  std::vector<std::string> warnings;
};

/// Throws FileError for inverse bind matrices that are no affine maps.
GltfBind read_gltf_bind(const GltfDocument& document);

/// False for a matrix that flattens space, so that it cannot be undone.
bool is_invertible(const Eigen::Affine3d& matrix);

}  // namespace sinew
