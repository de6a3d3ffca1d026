#pragma once

namespace sinew {

/// Calls of malloc and its relatives (operator new included) by any thread since the program began, but, from
/// the first question on, for OpenBLAS's own: its small products take some bytes a call on machines with 512-bit
/// registers.
/// Always 0 under the sanitizers, which bring a malloc of their own.
long allocation_count();

}  // namespace sinew
