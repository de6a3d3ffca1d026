#pragma once

#include <filesystem>

#include "io/mesh_asset.h"

namespace sinew {

/// Writes one frame as OBJ, with the source's vertices, order, texture coordinates and normals
/// recomputed; floats by shortest round trip. Whole or not at all. Throws FileError.
void write_obj(const std::filesystem::path& path, const MeshAsset& asset,
               const Eigen::Ref<const Field3>& positions);

}  // namespace sinew
