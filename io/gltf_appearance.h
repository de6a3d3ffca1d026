#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "io/gltf_folder.h"
#include "io/gltf_json.h"
#include "io/mesh_asset.h"

namespace sinew {

/// Materials, textures, samplers and images as MeshAsset carries them.
struct GltfAppearance {
  std::string json;  ///< see MeshAsset::appearance_json
  std::vector<SourceImage> images;
  std::vector<std::string> warnings;
};

/// The bytes of a buffer view, already range-checked.
using ViewBytes = std::function<std::span<const std::byte>(int view)>;

/// Copies the appearance out of a checked file. An image that cannot be had is left out together
/// with the textures that show it and the materials' references to those, with one warning.
/// Throws FileError for indices out of range.
GltfAppearance read_gltf_appearance(const JsonPlace& root, const AssetFolder& folder,
                                    const ViewBytes& view_bytes);

}  // namespace sinew
