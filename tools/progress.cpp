#include "tools/progress.h"

#include <unistd.h>

#include <cstdlib>
#include <iostream>

namespace sinew {
namespace {

constexpr int kBarWidth = 30;
/// Redraws a person can follow; more would only cost time.
constexpr std::chrono::milliseconds kRedrawEvery(50);

ProgressStyle settle(ProgressStyle style, bool quiet) {
  if (quiet) return ProgressStyle::none;
  if (style != ProgressStyle::automatic) return style;
  const char* terminal = std::getenv("TERM");
  const bool dumb = terminal != nullptr && std::string(terminal) == "dumb";
  return isatty(STDERR_FILENO) != 0 && !dumb ? ProgressStyle::bar : ProgressStyle::plain;
}

}  // namespace

Progress::Progress(ProgressStyle style, bool quiet) : style_(settle(style, quiet)) {}

void Progress::clear_line() {
  if (line_open_) std::cerr << "\r\033[K" << std::flush;
  line_open_ = false;
}

void Progress::stage(const std::string& name) {
  stage_ = name;
  last_tenth_ = -1;
  if (style_ == ProgressStyle::bar) {
    clear_line();
    std::cerr << name << " ..." << std::flush;
    line_open_ = true;
  } else if (style_ == ProgressStyle::plain) {
    std::cerr << name << '\n';
  } else if (style_ == ProgressStyle::json) {
    std::cerr << "{\"stage\":\"" << name << "\"}\n";
  }
}

void Progress::step(int done, int total) {
  if (style_ == ProgressStyle::none || total <= 0) return;
  if (style_ == ProgressStyle::json) {
    std::cerr << "{\"stage\":\"" << stage_ << "\",\"done\":" << done << ",\"total\":" << total << "}\n";
    return;
  }
  if (style_ == ProgressStyle::plain) {
    const int tenth = done * 10 / total;
    if (tenth != last_tenth_) std::cerr << stage_ << ": " << done << " of " << total << '\n';
    last_tenth_ = tenth;
    return;
  }
  const auto now = std::chrono::steady_clock::now();
  if (done < total && now - last_drawn_ < kRedrawEvery) return;
  last_drawn_ = now;
  const int filled = static_cast<int>(static_cast<long>(done) * kBarWidth / total);
  std::cerr << "\r\033[K" << stage_ << " [" << std::string(static_cast<std::size_t>(filled), '=')
            << std::string(static_cast<std::size_t>(kBarWidth - filled), ' ') << "] " << done << '/' << total
            << std::flush;
  line_open_ = true;
}

}  // namespace sinew
