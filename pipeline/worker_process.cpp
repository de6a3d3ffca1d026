#include "pipeline/worker_process.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <utility>

namespace sinew {
namespace {

using Clock = std::chrono::steady_clock;

/// Longest message that is read from the worker's standard error.
constexpr std::size_t kMessageBytes = 4096;

/// Exit code of a child whose program could not be started, as shells use it.
constexpr int kNotStarted = 127;

class FileDescriptor {
 public:
  FileDescriptor() = default;
  explicit FileDescriptor(int number) : number_(number) {}
  FileDescriptor(FileDescriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
  }
  ~FileDescriptor() { close(); }
  void close() {
    if (number_ >= 0) ::close(number_);
    number_ = -1;
  }
  int number() const { return number_; }
  bool open() const { return number_ >= 0; }

 private:
  int number_ = -1;
};

/// Two connected ends. Numbers 0 to 2 are left free: the child puts its own ends there.
struct Channel {
  FileDescriptor ours;
  FileDescriptor theirs;
};

FileDescriptor above_standard_streams(FileDescriptor descriptor) {
  if (descriptor.number() > 2) return descriptor;
  return FileDescriptor(fcntl(descriptor.number(), F_DUPFD_CLOEXEC, 3));
}

/// A socket pair rather than a pipe: writing to a worker that has died must not raise SIGPIPE in a
/// program that is not ours to change signal handlers in.
Channel open_channel() {
  std::array<int, 2> ends = {-1, -1};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) return {};
  Channel channel{above_standard_streams(FileDescriptor(ends[0])),
                  above_standard_streams(FileDescriptor(ends[1]))};
  if (channel.ours.open()) fcntl(channel.ours.number(), F_SETFL, O_NONBLOCK);
  return channel;
}

/// What the child needs after the fork, where nothing may be allocated.
struct Start {
  const char* program = nullptr;
  int input = -1;
  int output = -1;
  int messages = -1;
  rlimit processor_seconds = {};
  rlimit address_space = {};
  pid_t parent = 0;
};

/// Between fork and exec: only what is allowed in a signal handler.
[[noreturn]] void become_worker(const Start& start) {
  setpgid(0, 0);  // what the worker starts can then be ended with it
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != start.parent) _exit(kNotStarted);  // the parent died before the line above
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  signal(SIGPIPE, SIG_DFL);
  const rlimit no_core = {0, 0};
  setrlimit(RLIMIT_CORE, &no_core);
  setrlimit(RLIMIT_CPU, &start.processor_seconds);
  setrlimit(RLIMIT_AS, &start.address_space);
  if (dup2(start.input, 0) < 0 || dup2(start.output, 1) < 0 || dup2(start.messages, 2) < 0)
    _exit(kNotStarted);
  close_range(3, ~0U, 0);
  std::array<char*, 2> arguments = {const_cast<char*>(start.program), nullptr};
  execv(start.program, arguments.data());
  _exit(kNotStarted);
}

rlimit both(double value) {
  const auto limit = static_cast<rlim_t>(std::clamp(std::ceil(value), 1.0, 1e15));
  return {limit, limit};
}

/// Conversation with a running worker until it has ended.
class Conversation {
 public:
  Conversation(std::string_view input, const WorkerLimits& limits)
      : input_left_(input),
        limits_(limits),
        deadline_(Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                     std::chrono::duration<double>(std::min(limits.seconds, 1e6)))) {}

  WorkerResult hold(const std::string& program) {
    if (!start(program)) return {{}, std::string("could not be started: ") + std::strerror(errno)};
    std::string failure = talk();
    const std::string ending = end();
    if (failure.empty()) failure = ending;
    if (!failure.empty()) return {{}, failure};
    return {std::move(output_), {}};
  }

 private:
  bool start(const std::string& program) {
    Channel input = open_channel(), output = open_channel(), messages = open_channel();
    if (!input.theirs.open() || !output.theirs.open() || !messages.theirs.open()) return false;
    const Start start{program.c_str(),
                      input.theirs.number(),
                      output.theirs.number(),
                      messages.theirs.number(),
                      both(limits_.seconds + 1),
                      both(limits_.megabytes * 1048576.0),
                      getpid()};
    pid_ = fork();
    if (pid_ == 0) become_worker(start);
    if (pid_ < 0) return false;
    setpgid(pid_, pid_);  // here too: whoever comes first
    to_worker_ = std::move(input.ours);
    from_worker_ = std::move(output.ours);
    messages_ = std::move(messages.ours);
    return true;
  }

  /// Sends and receives until the worker is done. Returns why it has to be ended early, if so.
  std::string talk() {
    while (from_worker_.open() || messages_.open()) {
      const double left = std::chrono::duration<double>(deadline_ - Clock::now()).count();
      if (left <= 0.0) return "took longer than " + seconds_in_words();
      std::array<pollfd, 3> waiting = {{{from_worker_.number(), POLLIN, 0},
                                        {messages_.number(), POLLIN, 0},
                                        {to_worker_.number(), POLLOUT, 0}}};
      // Short naps: a grandchild may keep the streams open after the worker itself has gone. Asked
      // before the nap, so that nothing the worker wrote last is missed.
      const bool exited = has_exited();
      const int ready =
          poll(waiting.data(), waiting.size(), static_cast<int>(std::min(left * 1000.0 + 1.0, 20.0)));
      if (ready < 0 && errno != EINTR) return std::string("cannot be waited for: ") + std::strerror(errno);
      if (ready == 0 && exited) break;
      if (ready <= 0) continue;
      if (waiting[2].revents != 0) send_input();
      if (waiting[1].revents != 0) receive(messages_, message_, kMessageBytes);
      const auto most = static_cast<std::size_t>(std::min(limits_.megabytes * 1048576.0, 1e15));
      if (waiting[0].revents != 0 && !receive(from_worker_, output_, most)) {
        return "wrote more than its limit of " + std::to_string(static_cast<long long>(limits_.megabytes)) +
               " MB";
      }
    }
    while (!has_exited()) {
      if (Clock::now() >= deadline_) return "took longer than " + seconds_in_words();
      poll(nullptr, 0, 2);
    }
    return {};
  }

  void send_input() {
    const ssize_t sent = send(to_worker_.number(), input_left_.data(), input_left_.size(), MSG_NOSIGNAL);
    if (sent > 0) input_left_.remove_prefix(static_cast<std::size_t>(sent));
    const bool later = sent < 0 && (errno == EAGAIN || errno == EINTR);
    if (input_left_.empty() || (sent < 0 && !later)) to_worker_.close();  // the worker may not want it all
  }

  /// Appends what is there to `text`. False when that would be more than `most` bytes; what a message
  /// has beyond is read and forgotten.
  bool receive(FileDescriptor& from, std::string& text, std::size_t most) {
    std::array<char, 65536> buffer;
    const ssize_t count = read(from.number(), buffer.data(), buffer.size());
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) return true;
    if (count <= 0) {
      from.close();
      return true;
    }
    const std::size_t room = most - text.size();
    text.append(buffer.data(), std::min(room, static_cast<std::size_t>(count)));
    return static_cast<std::size_t>(count) <= room;
  }

  /// Without taking its exit status: until that is taken its number is not given to anyone else.
  bool has_exited() const {
    siginfo_t info = {};
    if (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) != 0)
      return errno != EINTR;
    return info.si_pid == pid_;
  }

  /// Kills what is left of the worker's process group and takes its exit status. Returns what that says
  /// against it.
  std::string end() {
    kill(-pid_, SIGKILL);
    int status = 0;
    pid_t waited = -1;
    do waited = waitpid(pid_, &status, 0);
    while (waited < 0 && errno == EINTR);
    if (waited != pid_) return "left no exit status";
    if (WIFSIGNALED(status)) return std::string("was ended by a signal: ") + strsignal(WTERMSIG(status));
    const int code = WEXITSTATUS(status);
    if (code == 0) return {};
    if (code == kNotStarted && message_.empty()) return "could not be started";
    const std::string line = first_line_of_message();
    return "stopped with code " + std::to_string(code) + (line.empty() ? "" : ": " + line);
  }

  std::string first_line_of_message() const {
    std::string line = message_.substr(0, std::min(message_.find('\n'), std::size_t{200}));
    std::erase_if(line, [](char c) { return !std::isprint(static_cast<unsigned char>(c)); });
    return line;
  }

  std::string seconds_in_words() const {
    std::string text = std::to_string(limits_.seconds);
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
    return text + " s";
  }

  std::string_view input_left_;
  WorkerLimits limits_;
  Clock::time_point deadline_;
  pid_t pid_ = -1;
  FileDescriptor to_worker_, from_worker_, messages_;
  std::string output_, message_;
};

}  // namespace

WorkerResult run_worker(const std::string& program, std::string_view input, const WorkerLimits& limits) {
  return Conversation(input, limits).hold(program);
}

}  // namespace sinew
