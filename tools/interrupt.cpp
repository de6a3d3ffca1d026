#include "tools/interrupt.h"

#include <csignal>

namespace sinew {
namespace {

volatile std::sig_atomic_t asked_signal = 0;

extern "C" void remember(int signal) { asked_signal = signal; }

}  // namespace

void watch_for_interrupts() {
  struct sigaction action {};
  action.sa_handler = remember;
  action.sa_flags = SA_RESETHAND | SA_RESTART;  // the second signal finds the default handler
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

ExitCode interrupt_asked() {
  if (asked_signal == SIGINT) return ExitCode::interrupted;
  if (asked_signal == SIGTERM) return ExitCode::terminated;
  return ExitCode::ok;
}

}  // namespace sinew
