#pragma once

#include <filesystem>

#include "io/mesh_asset.h"

namespace sinew {

/// Writes one frame as OBJ: the file's own vertices in its order (where the source was an OBJ, just as many),
/// texture coordinates, normals recomputed where the source had any, and its triangles, a group to each
/// primitive. Positions by shortest round trip. Whole or not at all.
///
/// `positions`: at least asset.mesh.vertex_count() rows; the top ones are the welded vertices. What no triangle
/// uses stays where the source has it. Throws FileError, std::invalid_argument when there are too few rows.
void write_obj(const std::filesystem::path& path, const MeshAsset& asset,
               const Eigen::Ref<const Field3>& positions);

}  // namespace sinew
