#pragma once

namespace sinew {

/// What the program's exit status says; the same for every verb.
enum class ExitCode {
  ok = 0,
  failed = 1,
  usage = 2,
  malformed_input = 3,
  unusable_input = 4,
  input_output = 5,
  resource_limit = 6,
  internal = 70,
  interrupted = 130,
  terminated = 143,
};

}  // namespace sinew
