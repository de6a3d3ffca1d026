#pragma once

#include <filesystem>
#include <string_view>

#include "skeleton/clip.h"

namespace sinew {

/// Reads a Biovision hierarchy file. Angles become quaternions (rotations multiplied in the file's
/// channel order), position channels *replace* OFFSET, on inner joints too; lengths stay in the file's
/// unit; end sites become tips. A frame time within 1e-4 of 1/N becomes N frames per second.
///
/// Real files disagree with each other and with themselves; what can be read in one way only is
/// read, and each repair is listed in Clip::warnings once, with its line:
/// W_BVH_EXTRA_ROWS, W_BVH_MISSING_ROWS: rows other than Frames: says; those present are used.
/// W_BVH_CUT_ROW: the file ends inside a row; it is left out.
/// W_BVH_WRAPPED_ROWS: frames do not keep to lines, but their values come out even.
/// W_BVH_NO_FRAME_COUNT, W_BVH_NO_FRAME_TIME (missing or zero: 30 frames per second).
/// W_BVH_TEXT_IN_MOTION: a comment, or text after the last row.
/// W_BVH_SEVERAL_ROOTS, W_BVH_END_WITHOUT_OFFSET, W_BVH_ROOT_AT_ORIGIN (positions may be meant as
/// added to OFFSET).
/// W_BVH_DECIMAL_COMMA: every number has a comma for its point and the file has no point anywhere;
/// any other comma is refused.
///
/// Throws FileError naming the line: among others for numbers that are not finite or exceed 1e12, rows of a
/// wrong length, channels other than CHANNELS counts, no frame at all. Files over 2 GiB, and clips of
/// more than a million transforms plus one a byte, are refused as too large. One pass over the text.
Clip read_bvh(const std::filesystem::path& path);

/// The same from memory; `name` stands for the file in messages.
Clip parse_bvh(std::string_view text, const std::filesystem::path& name);

}  // namespace sinew
