#pragma once

#include "tools/exit_codes.h"

namespace sinew {

/// From here on SIGINT and SIGTERM ask the program to stop after the frame in hand; a second one
/// ends it at once. SIGPIPE and SIGXFSZ become write errors.
void watch_for_interrupts();

/// ok while nobody asked; interrupted or terminated afterwards.
ExitCode interrupt_asked();

}  // namespace sinew
