// sinew-bench-peer: times one solver on one system. Reads its job from standard input as JSON, writes what
// it measured to standard output as JSON. `sinew bench` starts it; without a job it lists its solvers.
#include <malloc.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tools/bench/peer.h"

namespace sinew {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

/// Set-up is repeated until it has taken this long, but not more often than solves are.
constexpr double kSetupSeconds = 2.0;

/// Quick solves are repeated for this long for each repeat asked for: a median of a few milliseconds would be
/// the machine's mood.
constexpr double kSecondsPerRepeat = 0.3;

constexpr double kMegabyte = 1e6;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

/// A line of /proc/self/status in bytes.
double memory(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind(key + ":", 0) == 0) return 1024.0 * std::stod(line.substr(key.size() + 1));
  }
  return 0.0;
}

/// Resident bytes now, memory that was freed given back first.
double resident() {
  malloc_trim(0);
  return memory("VmRSS");
}

/// From here on the largest resident size is counted anew.
void forget_peak() {
  std::ofstream("/proc/self/clear_refs") << 5;
}

double true_residual(const PosedSystem& posed, const Columns& x) {
  Columns r;
  residual(posed.system, posed.b, x, r);
  return (r.colwise().norm().array() / posed.b.colwise().norm().array()).maxCoeff();
}

/// One tolerance: the solver is told to go as far as the true residual needs.
json time_solves(Peer& peer, const PosedSystem& posed, double tolerance, int repeats) {
  Columns x;
  double asked = tolerance;
  double reached = 0.0;
  int iterations = 0;
  for (int attempt = 0; attempt < 4; ++attempt) {
    iterations = peer.solve(asked);
    peer.answer(x);
    reached = true_residual(posed, x);
    if (reached <= tolerance) break;
    asked *= 0.9 * tolerance / reached;
  }
  std::vector<double> seconds;
  double spent = 0.0;
  for (int repeat = 0; repeat < repeats || spent < kSecondsPerRepeat * repeats; ++repeat) {
    const auto start = Clock::now();
    peer.solve(asked);
    seconds.push_back(peer.largest(seconds_since(start)));
    spent += seconds.back();
  }
  return {{"tolerance", tolerance},
          {"seconds", median(seconds)},
          {"least_seconds", *std::min_element(seconds.begin(), seconds.end())},
          {"iterations", iterations},
          {"residual", reached},
          {"reached", reached <= tolerance},
          {"vertex_error", vertex_error(posed, x)}};
}

json time_setups(Peer& peer, int repeats, json& result) {
  std::vector<double> seconds;
  double spent = 0.0;
  for (int repeat = 0; repeat < repeats && (repeat == 0 || spent < kSetupSeconds); ++repeat) {
    if (repeat > 0) peer.tear_down();
    const double before = resident();
    if (repeat == 0) forget_peak();
    const auto start = Clock::now();
    peer.set_up();
    seconds.push_back(peer.largest(seconds_since(start)));
    spent += seconds.back();
    if (repeat > 0) continue;
    peer.solve(1e-3);  // what a solver allocates at its first solve is its memory too
    const double peak = memory("VmHWM");
    result["memory_mb"] = peer.sum(resident() - before) / kMegabyte;
    result["peak_mb"] = peer.sum(peak - before) / kMegabyte;
  }
  return median(seconds);
}

json measure(const json& job) {
  const auto kinds = peer_kinds();
  const std::string name = job.at("solver");
  const auto kind =
      std::find_if(kinds.begin(), kinds.end(), [&](const PeerKind& k) { return name == k.name; });
  if (kind == kinds.end()) throw std::runtime_error("no solver '" + name + "' was found at configure time");
  const PosedSystem posed = read_posed_system(job.at("file").get<std::string>());
  const int repeats = job.at("repeats");
  const std::unique_ptr<Peer> peer = kind->make(job.at("threads"));
  peer->load(posed);
  json result;
  result["setup_s"] = time_setups(*peer, repeats, result);
  for (const double tolerance : job.at("tolerances").get<std::vector<double>>()) {
    result["solves"].push_back(time_solves(*peer, posed, tolerance, repeats));
  }
  result["figures"] = json::object();
  for (const auto& [figure, value] : peer->figures()) result["figures"][figure] = value;
  result["settings"] = peer->settings();
  result["solver_bytes"] = peer->bytes();
  if (!peer->reports()) return {};
  return result;
}

/// Thread counts of OpenMP and BLAS are read when those libraries are loaded: so they are set here, and
/// the program started anew with its job as argument. Hypre has no threads in most builds of it: it gets as
/// many MPI ranks where there is an mpirun, and one otherwise.
[[noreturn]] void start_with_job(const std::string& text) {
  const json job = json::parse(text);
  const std::string threads = std::to_string(job.at("threads").get<int>());
  setenv("OMP_NUM_THREADS", threads.c_str(), 1);
  setenv("OPENBLAS_NUM_THREADS", threads.c_str(), 1);
  setenv("OMPI_MCA_ess_singleton_isolated", "1", 1);  // one rank alone starts no daemon
  if (job.at("solver") == "hypre" && job.at("threads") > 1) {
    const std::string self = std::filesystem::read_symlink("/proc/self/exe");
    execlp("mpirun", "mpirun", "--allow-run-as-root", "--oversubscribe", "-n", threads.c_str(), self.c_str(),
           text.c_str(), nullptr);
  }
  execl("/proc/self/exe", "sinew-bench-peer", text.c_str(), nullptr);
  throw std::runtime_error(std::string("cannot start itself: ") + std::strerror(errno));
}

extern "C" void end_late(int) {
  constexpr char text[] = "ran out of time\n";
  [[maybe_unused]] const auto written = write(STDERR_FILENO, text, sizeof text - 1);
  _exit(1);
}

void end_after(double seconds) {
  std::signal(SIGALRM, end_late);
  itimerval timer = {};
  timer.it_value.tv_sec = static_cast<time_t>(seconds);
  timer.it_value.tv_usec =
      static_cast<suseconds_t>(1e6 * (seconds - static_cast<double>(timer.it_value.tv_sec)));
  setitimer(ITIMER_REAL, &timer, nullptr);
}

void list_solvers() {
  for (const PeerKind& kind : peer_kinds()) std::cout << kind.name << '\n';
}

}  // namespace

std::span<const PeerKind> peer_kinds() {
  static constexpr PeerKind kKinds[] = {
      {"sinew", make_sinew_peer},     {"shi2006", make_shi2006_peer}, {"cholmod", make_cholmod_peer},
#ifdef SINEW_BENCH_HYPRE
      {"hypre", make_hypre_peer},
#endif
#ifdef SINEW_BENCH_ML
      {"trilinos_ml", make_ml_peer},
#endif
#ifdef SINEW_BENCH_AMGCL
      {"amgcl", make_amgcl_peer},
#endif
      {"eigen_pcg", make_eigen_peer},
  };
  return kKinds;
}

}  // namespace sinew

int main(int argc, char** argv) try {
  using namespace sinew;
  if (argc < 2) {
    const std::string text(std::istreambuf_iterator<char>(std::cin), {});
    if (text.empty()) return list_solvers(), 0;
    start_with_job(text);
  }
  const json job = json::parse(argv[1]);
  end_after(job.at("seconds"));
  const json result = measure(job);
  if (!result.is_null()) std::cout << result.dump() << '\n';
} catch (const std::bad_alloc&) {
  std::cerr << "ran out of memory\n";
  return 1;
} catch (const std::exception& error) {
  std::cerr << error.what() << '\n';
  return 1;
}
