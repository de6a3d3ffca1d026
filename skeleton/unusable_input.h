#pragma once

#include <stdexcept>

namespace sinew {

/// Valid input that cannot be used for what was asked (exit code 4): no volume, joints that do not
/// match, a body without bones. The message is one line and says what would help.
class UnusableInput : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace sinew
