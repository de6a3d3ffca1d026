#pragma once

#include <string>
#include <vector>

#include "io/gltf_json.h"

namespace sinew {

/// Checks everything the reader will rely on in a glTF file's JSON, before any of it is used: kinds of
/// values, every index, every byte range (in 64-bit arithmetic that cannot wrap), node trees without
/// cycles or second parents, animation targets. Numbers inside buffers are checked where they are read.
///
/// `has_binary`: the file is a GLB with a BIN chunk of `binary_size` bytes. Throws FileError: malformed,
/// or unusable for another glTF version and for required extensions that are not known here, by name.
void check_gltf(const JsonPlace& root, bool has_binary, std::uint64_t binary_size);

/// Bytes of one component of that glTF type code; 0 for a code glTF does not know.
int component_size(std::uint64_t component_type);
/// Components of "SCALAR", "VEC2", ...; 0 for another word.
int component_count(const std::string& type);

}  // namespace sinew
