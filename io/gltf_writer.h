#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/mesh_asset.h"

namespace sinew {

/// How a clip is stored.
enum class GltfKind {
  pca,    ///< at most 63 morph targets that span the motion, weights in [0, 1], morph normals
  exact,  ///< one target per kept frame, in chunks of at most 63 targets a mesh
};

struct GltfWriterOptions {
  GltfKind kind = GltfKind::pca;
  double frames_per_second = 30.0;
  int max_targets = 63;     ///< pca: including the offset target; 2 to 63
  double tolerance = 1e-3;  ///< pca: fewest targets whose error (p99.9, share of the diagonal) stays below
  double key_tolerance =
      0.0;              ///< exact: frames that interpolation gives to this share of the diagonal are dropped
  bool normals = true;  ///< false: no normals, half the size; viewers then shade flat
  std::string animation_name = "animation";
  std::int64_t max_bytes = 4'000'000'000;  ///< refused before writing when the file would be larger
};

/// What was written; errors measured on the stored numbers, as shares of the rest bounding-box diagonal.
struct GltfWriteReport {
  std::int64_t bytes = 0;
  int targets = 0;  ///< distinct ones; in exact mode as many as kept frames
  double max_error = 0.0;
  double p999_error = 0.0;
  double rms_error = 0.0;
  std::vector<std::string> warnings;
};

/// Takes the mesh once and frames in order; writes one .glb with the source's primitives,
/// attributes and materials. Keeps all frames in memory as floats (12 bytes a vertex and frame).
///
/// pca: each frame's best rigid motion goes to an animated node, what is left to morph targets, so
/// that a walk across the room costs no targets. exact: vertex positions at each key are the given
/// ones to float rounding. Normals follow the motion in both, as morph normals; tangents and other
/// attributes stay as in the source. Same frames, same bytes. Only what every viewer reads is
/// used: dense accessors, weights in [0, 1], at most 63 targets a mesh, no required extension.
class GltfWriter {
 public:
  /// `asset` is borrowed and must outlive the writer. Throws std::invalid_argument when an option is out of
  /// range or the asset's parts do not fit together.
  GltfWriter(const MeshAsset& asset, const GltfWriterOptions& options);

  /// `positions`: at least asset.mesh.vertex_count() rows; the top ones are the welded vertices.
  /// Throws std::invalid_argument when there are fewer, or one is not finite.
  void add_frame(const Eigen::Ref<const Field3>& positions);

  /// Writes the file whole or not at all. Throws FileError (resource when it would be larger than
  /// max_bytes, found before anything is built in exact mode), std::invalid_argument without frames.
  GltfWriteReport write(const std::filesystem::path& path) const;

 private:
  const MeshAsset& asset_;
  GltfWriterOptions options_;
  std::vector<std::vector<float>> frames_;
};

}  // namespace sinew
