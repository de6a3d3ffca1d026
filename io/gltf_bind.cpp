#include "io/gltf_bind.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "io/file_error.h"
#include "io/gltf_tracks.h"

namespace sinew {
namespace {

/// Bind matrices of two skins that differ by less than this share of their size mean the same pose:
/// they are stored as floats, after a few multiplications by whoever wrote them.
constexpr double kSamePose = 1e-4;

/// The same for one skin against the file's own nodes, whose rotations may come from keys: sloppier.
constexpr double kAtRest = 1e-2;

/// Steps up the tree from skins to roots: a second's worth. Real files take a few hundred.
constexpr std::int64_t kMostClimbs = 20'000'000;

std::vector<Eigen::Affine3d> read_inverse_bind(const GltfDocument& document, int index) {
  const GltfSkin& skin = document.skins[index];
  std::vector<Eigen::Affine3d> matrices(skin.joints.size(), Eigen::Affine3d::Identity());
  if (skin.inverse_bind < 0) return matrices;
  const std::vector<double> numbers = read_numbers(document, skin.inverse_bind);
  for (std::size_t i = 0; i < matrices.size(); ++i) {
    const Eigen::Matrix4d matrix = Eigen::Map<const Eigen::Matrix4d>(numbers.data() + 16 * i);
    if ((matrix.row(3) - Eigen::RowVector4d::UnitW()).norm() > 1e-4) {
      throw FileError(FileFault::malformed, document.where("skins", index) + "/inverseBindMatrices",
                      "the last row of matrix " + std::to_string(i) + " is not 0 0 0 1");
    }
    matrices[i].matrix().topRows<3>() = matrix.topRows<3>();
  }
  return matrices;
}

bool agree(const Eigen::Affine3d& a, const Eigen::Affine3d& b) {
  return (a.linear() - b.linear()).norm() <= kSamePose * b.linear().norm() &&
         (a.translation() - b.translation()).norm() <=
             kSamePose * (b.linear().norm() + b.translation().norm());
}

/// True when `a` and `b` differ as two poses of one thing do, rather than as two conventions do, which
/// differ by quarter turns, mirrors and units.
bool is_likely(const Eigen::Affine3d& a, const Eigen::Affine3d& b) {
  if (!is_invertible(a) || !is_invertible(b)) return false;
  const double ratio = a.linear().determinant() / b.linear().determinant();
  const double cosine = std::abs(nearest_rotation(a.linear()).dot(nearest_rotation(b.linear())));
  constexpr double kHalfOf45Degrees = 0.3926990816987241;
  return std::abs(ratio - 1.0) < 0.01 && cosine > std::cos(kHalfOf45Degrees);
}

class BindPose {
 public:
  explicit BindPose(const GltfDocument& document)
      : document_(document),
        rest_world_(node_worlds(document, rest_locals(document))),
        fixed_(document.nodes.size()),
        rank_(document.nodes.size()) {
    for (std::size_t i = 0; i < document.node_order.size(); ++i)
      rank_[document.node_order[i]] = static_cast<int>(i);
  }

  GltfBind read() {
    find_drawn_skins();
    bind_.inverse_bind.resize(document_.skins.size());
    for (const int skin : bind_.skins) {
      bind_.inverse_bind[skin] = read_inverse_bind(document_, skin);
      place(skin);
    }
    finish();
    return std::move(bind_);
  }

 private:
  void find_drawn_skins() {
    drawn_by_.assign(document_.skins.size(), -1);
    for (const int node : document_.scene_order) {
      const int skin = document_.nodes[node].mesh >= 0 ? document_.nodes[node].skin : -1;
      if (skin < 0 || drawn_by_[skin] >= 0) continue;
      drawn_by_[skin] = node;
      bind_.skins.push_back(skin);
    }
    if (!bind_.skins.empty()) return;
    for (std::size_t skin = 0; skin < document_.skins.size(); ++skin)
      bind_.skins.push_back(static_cast<int>(skin));
  }

  Eigen::Affine3d local(int node) const {
    const GltfNode& at = document_.nodes[node];
    return at.rest_matrix ? *at.rest_matrix : at.rest.matrix();
  }

  /// With what is known so far.
  Eigen::Affine3d world(int node) {
    Eigen::Affine3d result = Eigen::Affine3d::Identity();
    for (int at = node; at >= 0; at = document_.nodes[at].parent) {
      if (++climbed_ > kMostClimbs) {
        throw FileError(FileFault::resource, document_.file,
                        "has too many skins in too deep a tree of nodes");
      }
      if (fixed_[at]) return *fixed_[at] * result;
      result = local(at) * result;
    }
    return result;
  }

  /// The entry of the skin's joints that says where its mesh is: the first in the tree that an earlier
  /// skin has placed already, or else the first in the tree.
  std::size_t leading_joint(const GltfSkin& skin) const {
    const auto before = [&](int a, int b) {
      if (fixed_[a].has_value() != fixed_[b].has_value()) return fixed_[a].has_value();
      return rank_[a] < rank_[b];
    };
    return static_cast<std::size_t>(std::min_element(skin.joints.begin(), skin.joints.end(), before) -
                                    skin.joints.begin());
  }

  bool is_at_rest(const GltfSkin& skin, const std::vector<Eigen::Affine3d>& inverse_bind,
                  std::size_t leader) const {
    const Eigen::Matrix3d expected = (rest_world_[skin.joints[leader]] * inverse_bind[leader]).linear();
    for (std::size_t i = 0; i < skin.joints.size(); ++i) {
      const Eigen::Matrix3d difference = (rest_world_[skin.joints[i]] * inverse_bind[i]).linear() - expected;
      if (difference.norm() > kAtRest * expected.norm()) return false;
    }
    return true;
  }

  Eigen::Affine3d mesh_to_scene_of(int index) {
    const GltfSkin& skin = document_.skins[index];
    const std::vector<Eigen::Affine3d>& inverse_bind = bind_.inverse_bind[index];
    const std::size_t leader = leading_joint(skin);
    const Eigen::Affine3d by_joint = world(skin.joints[leader]) * inverse_bind[leader];
    if (fixed_[skin.joints[leader]] || is_at_rest(skin, inverse_bind, leader)) return by_joint;
    if (drawn_by_[index] < 0) return by_joint;
    const Eigen::Affine3d by_node = world(drawn_by_[index]);
    return is_likely(by_node, by_joint) ? by_node : by_joint;
  }

  void place(int index) {
    const GltfSkin& skin = document_.skins[index];
    const std::vector<Eigen::Affine3d>& inverse_bind = bind_.inverse_bind[index];
    const Eigen::Affine3d mesh_to_scene = mesh_to_scene_of(index);
    for (std::size_t i = 0; i < skin.joints.size(); ++i) {
      std::optional<Eigen::Affine3d>& joint = fixed_[skin.joints[i]];
      if (joint) {
        if (!agree(*joint * inverse_bind[i], mesh_to_scene)) ++differing_;
      } else if (is_invertible(inverse_bind[i])) {
        joint = mesh_to_scene * inverse_bind[i].inverse();
      } else {
        ++flat_;  // follows its parent, as a node that is no joint
      }
    }
  }

  void finish() {
    std::vector<bool> is_joint(document_.nodes.size(), false);
    for (const int skin : bind_.skins) {
      for (const int joint : document_.skins[skin].joints) is_joint[joint] = true;
    }
    bind_.world.resize(document_.nodes.size());
    for (const int node : document_.node_order) {
      const int parent = document_.nodes[node].parent;
      if (fixed_[node])
        bind_.world[node] = *fixed_[node];
      else
        bind_.world[node] = parent < 0 ? local(node) : bind_.world[parent] * local(node);
      if (!bind_.world[node].matrix().allFinite()) {
        throw FileError(FileFault::malformed, document_.where("nodes", node),
                        "its place in the scene is not finite");
      }
      if (is_joint[node]) bind_.joints.push_back(node);
    }
    if (differing_ > 0) {
      bind_.warnings.push_back(
          "W_GLTF_BIND: skins differ in the bind pose of " + std::to_string(differing_) +
          " shared joint(s); the first skin's holds, and the others' meshes are posed to it");
    }
    if (flat_ > 0) {
      bind_.warnings.push_back(
          "W_GLTF_BIND: " + std::to_string(flat_) +
          " inverse bind matrices cannot be inverted; those joints bind where their nodes are");
    }
  }

  const GltfDocument& document_;
  std::vector<Eigen::Affine3d> rest_world_;
  std::vector<std::optional<Eigen::Affine3d>> fixed_;
  std::vector<int> rank_;  ///< of a node in node_order
  GltfBind bind_;
  std::vector<int> drawn_by_;  ///< per skin of the file, the first node that draws with it
  std::int64_t climbed_ = 0;
  int differing_ = 0;
  int flat_ = 0;
};

}  // namespace

bool is_invertible(const Eigen::Affine3d& matrix) {
  const double size = matrix.linear().norm();
  return std::isfinite(size) && std::abs(matrix.linear().determinant()) > 1e-12 * size * size * size;
}

GltfBind read_gltf_bind(const GltfDocument& document) {
  return BindPose(document).read();
}

}  // namespace sinew
