#pragma once

#include <string>

#include "io/file_error.h"

namespace sinew {

/// What a person is told when `read` refuses; "accepted" when it does not.
template <class Read>
std::string refusal(const Read& read) {
  try {
    read();
  } catch (const FileError& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace sinew
