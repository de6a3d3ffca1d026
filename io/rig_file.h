#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "skeleton/rig_skeleton.h"

namespace sinew {

/// Reads a rig file (TOML, "sinew.rig/1", described in docs/rig-file.md). Throws FileError naming the line.
RigSkeleton read_rig(const std::filesystem::path& path);
RigSkeleton parse_rig(std::string_view text, const std::filesystem::path& name);

/// The rig file's text; reading it back gives the same rig. Throws std::invalid_argument when the rig breaks its
/// invariants or two joints share a name, which a file could not say.
std::string to_rig_text(const RigSkeleton& rig);

}  // namespace sinew
