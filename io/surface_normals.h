#pragma once

#include <array>
#include <span>
#include <vector>

#include "io/mesh_asset.h"

namespace sinew {

/// Normals of a deforming mesh, smooth where the source's are smooth and hard where they are hard.
///
/// Rows of the source at one welded vertex whose rest normals agree form a group and share a normal:
/// the area-weighted mean over the triangles at the group. Without normals in the source all rows of
/// a vertex are one group. Where the source's own normal differs from that mean (painted or weighted
/// ones) it is carried along by the smallest turn that takes the mean at rest to the mean now.
class SurfaceNormals {
 public:
  /// `asset` is read here and not kept. Linear.
  explicit SurfaceNormals(const MeshAsset& asset);

  int group_count() const { return static_cast<int>(rest_.size() / 3); }
  /// One entry a row of the source; -1 for a row that no triangle uses.
  const std::vector<int>& group_of_row() const { return group_of_row_; }

  /// Three floats a row of the source, unit length: the source's own or the computed ones.
  const std::vector<float>& rest_of_rows() const { return rest_of_rows_; }
  /// Three numbers a group, unit length.
  const std::vector<double>& rest() const { return rest_; }

  /// `positions`: three numbers a welded vertex; `normals`: three a group, unit length.
  void deformed(std::span<const double> positions, std::span<double> normals) const;

 private:
  struct Corner {
    int vertex;
    int group;
  };
  void sum_area_normals(std::span<const double> positions, std::span<double> sums) const;

  std::vector<int> group_of_row_;
  std::vector<std::array<Corner, 3>> triangles_;
  std::vector<float> rest_of_rows_;
  std::vector<double> rest_;
  std::vector<double> computed_rest_;
};

}  // namespace sinew
