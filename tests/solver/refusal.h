#pragma once

#include <stdexcept>
#include <string>

namespace sinew {

/// What std::invalid_argument said when `call` threw it; empty when it did not.
template <typename Call>
std::string refusal(const Call& call) {
  try {
    call();
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return {};
}

}  // namespace sinew
