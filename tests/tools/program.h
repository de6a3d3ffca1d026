#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace sinew::test {

/// How a run of the program ended.
struct ProgramRun {
  int exit_code = -1;      ///< -1 when a signal ended it
  int signal = 0;
  double seconds = 0.0;    ///< processor time, user and system
  long peak_kilobytes = 0;
  std::string output;
  std::string errors;
};

/// Runs the program as a person would, with standard input closed.
ProgramRun run_sinew(const std::vector<std::string>& arguments);

/// A folder of its own for one test, emptied first.
std::filesystem::path scratch(const std::string& name);

std::string contents(const std::filesystem::path& path);

}  // namespace sinew::test
