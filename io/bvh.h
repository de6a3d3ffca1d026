#pragma once

#include <filesystem>
#include <string_view>

#include "skeleton/clip.h"

namespace sinew {

/// Reads a Biovision hierarchy file. Angles become quaternions (rotations multiplied in the file's
/// channel order), position channels *replace* OFFSET, lengths stay in the file's unit. Repairs are
/// listed in Clip::warnings, each once, with its line. Throws FileError naming the line.
Clip read_bvh(const std::filesystem::path& path);

/// The same from memory; `name` stands for the file in messages.
Clip parse_bvh(std::string_view text, const std::filesystem::path& name);

}  // namespace sinew
