#pragma once

#include <string>
#include <vector>

#include "pipeline/frame_solver.h"

namespace sinew {

/// What --start takes, and what it means.
std::vector<std::string> start_names();
/// `name` is one of start_names().
Start start_named(const std::string& name);

}  // namespace sinew
