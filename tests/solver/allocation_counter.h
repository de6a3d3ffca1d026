#pragma once

namespace sinew {

/// Calls of malloc and its relatives (operator new included) by any thread since the program began.
/// Always 0 under the sanitizers, which bring a malloc of their own.
long allocation_count();
/// What they asked for, together.
long allocated_bytes();

}  // namespace sinew
