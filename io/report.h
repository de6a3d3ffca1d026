#pragma once

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/gltf_writer.h"
#include "pipeline/frame_solver.h"
#include "pipeline/preview.h"
#include "pipeline/timing.h"

namespace sinew {

/// A file that went in, named by its content.
struct InputRecord {
  std::string role;  ///< "mesh", "clip", "rig"
  std::string path;  ///< as the user gave it
  std::int64_t bytes = 0;
  std::string sha256;
};
/// Reads the file and hashes it. Throws FileError.
InputRecord describe_input(const std::string& role, const std::filesystem::path& path);

struct MachineRecord {
  std::string processor;  ///< as the system names it; "unknown" where it does not
  int hardware_threads = 0;
  int threads = 0;      ///< that the run used
  bool native = false;  ///< compiled for the building machine's processor
};
MachineRecord describe_machine(int threads);

/// Largest resident memory of this process so far, bytes.
std::int64_t peak_memory();

struct SizeRecord {
  std::int64_t surface_vertices = 0;
  std::int64_t surface_triangles = 0;
  std::int64_t graph_nodes = 0;
  std::int64_t free_nodes = 0;
  std::int64_t edges = 0;
  std::int64_t rig_bytes = 0;
};

struct FrameRecord {
  int frame = 0;  ///< of the motion, 0-based
  FrameReport report;
  double volume_ratio = 1.0;            ///< enclosed volume over the rest one
  double farthest_from_skeleton = 0.0;  ///< share of the rest body's height
};

/// What a run did, in numbers that were measured in it. A plain struct to fill; report_json() and
/// operator<< only read it.
struct Report {
  std::vector<InputRecord> inputs;
  std::vector<std::pair<std::string, std::string>> options;  ///< as resolved, in the order to show
  MachineRecord machine;
  std::vector<std::string> warnings;
  TimingReport setup;  ///< stages before the first frame
  SizeRecord sizes;
  std::optional<PreviewError> preview;  ///< measured, where the frames are previews
  std::vector<FrameRecord> frames;
  double frames_milliseconds = 0.0;  ///< wall time of all frames together
  std::string output;                ///< path written; empty: none
  GltfWriteReport written;
  double write_milliseconds = 0.0;
  std::int64_t peak_memory_bytes = 0;
};

/// Median, 95th and 99th percentile (nearest rank) and largest of some values; zeros without any.
struct Spread {
  double median = 0.0;
  double p95 = 0.0;
  double p99 = 0.0;
  double max = 0.0;
};
Spread spread_of(std::vector<double> values);

/// JSON with schema "sinew.report/1"; keys in a fixed order, indented by two. Milliseconds are those
/// of the thread that solved the frame. Numbers that are not finite become null.
std::string report_json(const Report& report);

/// Writes report_json() whole or not at all. Throws FileError.
void write_report(const std::filesystem::path& path, const Report& report);

/// The short table for the end of a run.
std::ostream& operator<<(std::ostream& out, const Report& report);

}  // namespace sinew
