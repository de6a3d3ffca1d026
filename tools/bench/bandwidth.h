#pragma once

#include "solver/thread_team.h"

namespace sinew {

/// Bytes a second that the team's threads together read from memory, far more than any cache holds: the most
/// of several passes, each thread over a part of its own. Takes about a second and 512 MB.
double read_bandwidth(ThreadTeam& team);

}  // namespace sinew
