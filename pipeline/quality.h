#pragma once

#include <array>
#include <vector>

#include "pipeline/rig.h"
#include "skeleton/pose.h"

namespace sinew {

/// Surface edges' lengths over their rest lengths.
struct EdgeStretch {
  double percentile_1 = 1.0;
  double percentile_99 = 1.0;
  double least = 1.0;
  double largest = 1.0;
};

/// A closed piece of surface: triangles and, round each of its cuts, the rim to be closed by a fan.
struct SurfacePatch {
  std::vector<std::array<int, 3>> triangles;
  std::vector<std::vector<std::array<int, 2>>> rims;  ///< per cut: directed edges as its triangles run them
};

/// Measures how well deformed shapes of one rig keep the rest shape's virtues. Set-up looks at the rest shape;
/// each measure then takes positions, node_count x 3 (for measures of the surface its rows suffice).
class QualityMeter {
 public:
  explicit QualityMeter(const Rig& rig);

  /// Enclosed volume over the rest one.
  double volume_ratio(const Field3& positions) const;

  /// Volume of the piece of body within three local thicknesses of the joint, its cuts closed flat, over the
  /// rest one. 1 for a joint outside the body.
  double local_volume_ratio(int joint, const Field3& positions) const;

  EdgeStretch edge_stretch(const Field3& positions) const;

  /// Edges between triangles that fold back on one another (normals more than 120 degrees apart)
  /// and did not at rest.
  int folded_edges(const Field3& positions) const;

  /// Largest distance of the deformed bone axes from where the pose carries them rigidly, in local
  /// thicknesses. An axis point is carried by the interior nodes round it.
  double bone_drift(const Pose& pose, const Field3& positions) const;

  /// Pairs of triangles without a common vertex that cut through one another.
  int self_intersections(const Field3& positions) const;

 private:
  struct SurfaceEdge {
    int a = 0;
    int b = 0;
    std::array<int, 2> triangles{-1, -1};
    double rest_length = 0.0;
    bool folded_at_rest = false;
  };
  struct AxisPoint {
    int joint = 0;      ///< of the bone it belongs to
    int end_joint = -1;
    double along = 0.0;
    Eigen::Vector3d rest;
    double thickness = 0.0;
    std::vector<std::pair<int, double>> carriers;  ///< nodes and weights that reproduce `rest`
  };

  void find_edges();
  void find_patches();
  void find_axis_points();

  const Rig& rig_;
  double rest_volume_ = 0.0;
  std::vector<SurfaceEdge> edges_;
  std::vector<SurfacePatch> patches_;  ///< per joint
  std::vector<double> patch_volumes_;
  std::vector<AxisPoint> axis_points_;
};

}  // namespace sinew
