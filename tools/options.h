#pragma once

#include "tools/exit_codes.h"

namespace sinew {

/// Reads the command line, and the TOML file named by --config, and runs the verb found. The one file
/// that knows flags is options.cpp. Usage errors are printed as one line.
ExitCode run_command_line(int argc, char** argv);

}  // namespace sinew
