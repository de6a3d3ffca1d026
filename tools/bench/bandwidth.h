#pragma once

#include "solver/thread_team.h"

namespace sinew {

/// Bytes a second that the team's threads together read from memory, far more than any cache holds: the
/// median of several passes, for on a shared machine the best is a moment nobody else was there. Takes about
/// a second and 512 MB.
double read_bandwidth(ThreadTeam& team);

}  // namespace sinew
