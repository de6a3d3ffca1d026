#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "io/mesh_asset.h"
#include "skeleton/clip.h"
#include "skeleton/retarget.h"
#include "skeleton/rig_skeleton.h"

namespace sinew {

struct GltfAnimationSummary {
  std::string name;
  double seconds = 0.0;
  int channels = 0;
  int joints = 0;  ///< nodes it moves
};
struct GltfSkinSummary {
  std::string name;
  int joints = 0;
};

/// A glTF or GLB file, read once, every index and range in it checked.
class GltfFile {
 public:
  /// Throws FileError. Opens nothing outside the file's own folder.
  explicit GltfFile(const std::filesystem::path& path);
  ~GltfFile();
  GltfFile(GltfFile&&) noexcept;
  GltfFile& operator=(GltfFile&&) noexcept;

  std::vector<GltfSkinSummary> skins() const;
  std::vector<GltfAnimationSummary> animations() const;

  /// All triangle primitives of the scene at bind, in scene space. Throws FileError (unusable) when
  /// there is none.
  MeshAsset mesh() const;

  /// The bind pose of the skin (of all skins, merged by node) as a rig in scene space, roles
  /// recognised by name where possible; nothing when the file has no skin. Joints that move nothing
  /// (inverse-kinematics handles, pole targets: neither they nor a joint below has vertices) are left
  /// out. Leaf joints have a tip where vertices follow them. Up is Y; the front is where left and right
  /// say, or else Z.
  std::optional<RigSkeleton> rig() const;

  /// An animation by name, by index ("0"), or the first one when empty, sampled at `frames_per_second`,
  /// as a clip of the file's node tree (for moving another body).
  Clip clip(const std::string& animation, double frames_per_second) const;

  /// The same animation as a motion of rig(): exact, nothing retargeted.
  Motion motion(const std::string& animation, double frames_per_second) const;

  /// The vertices of mesh() (source rows) as linear blend skinning with the file's own weights puts
  /// them at `seconds` into the animation. For tests and comparisons.
  Field3 skinned_positions(const std::string& animation, double seconds) const;

 private:
  struct Members;
  std::unique_ptr<Members> members_;
};

}  // namespace sinew
