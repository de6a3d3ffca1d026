#pragma once

#include <filesystem>
#include <stdexcept>
#include <string>

namespace sinew {

/// What is wrong with a file, as the exit code tells it.
enum class FileFault {
  malformed = 3,  ///< not what its format says
  unusable = 4,   ///< well formed, but cannot be used (a required extension, no triangles)
  input_output = 5,  ///< cannot be opened, read or written
  resource = 6,   ///< larger than a stated limit
};

/// One line: "where: what was found, what was expected". `where` is FILE, FILE:LINE,
/// FILE@BYTE or FILE:/json/pointer.
class FileError : public std::runtime_error {
 public:
  FileError(FileFault fault, const std::string& where, const std::string& what)
      : std::runtime_error(where + ": " + what), fault_(fault) {}
  FileError(const std::filesystem::path& file, long line, const std::string& what)
      : FileError(FileFault::malformed, file.string() + ":" + std::to_string(line), what) {}
  FileFault fault() const { return fault_; }

 private:
  FileFault fault_;
};

}  // namespace sinew
