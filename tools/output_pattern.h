#pragma once

#include <filesystem>

namespace sinew {

/// The name of one frame's file: "####" (any run of #) or "{frame:04}" / "{frame}" in the file name becomes the frame's
/// number, padded with zeros to that width; without either, "_0001" is put before the extension.
std::filesystem::path numbered(const std::filesystem::path& pattern, int frame);

}  // namespace sinew
