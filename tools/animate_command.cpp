#include <unistd.h>

#include <algorithm>
#include <iostream>
#include <optional>
#include <sstream>

#include "io/bvh.h"
#include "io/file_error.h"
#include "io/gltf_reader.h"
#include "io/gltf_writer.h"
#include "io/mesh_asset.h"
#include "io/obj_writer.h"
#include "io/report.h"
#include "io/rig_file.h"
#include "pipeline/animate.h"
#include "skeleton/unusable_input.h"
#include "tools/commands.h"
#include "tools/frame_range.h"
#include "tools/interrupt.h"
#include "tools/output_pattern.h"
#include "tools/progress.h"
#include "tools/start_names.h"

namespace sinew {
namespace {

/// glTF keys lie at any time: sampled at this rate unless --fps says otherwise.
constexpr double kGltfFramesPerSecond = 30.0;

/// Frames of a clip that are solved to say how far previews are off.
constexpr int kMeasuredPreviews = 9;

bool is_gltf(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char letter) { return std::tolower(letter); });
  return extension == ".gltf" || extension == ".glb";
}

struct Inputs {
  MeshAsset asset;
  RigSkeleton rig;
  Motion motion;
};

/// Whatever clip file was named, as a clip with its own skeleton.
Clip read_clip(const AnimateCommandOptions& options) {
  if (!is_gltf(options.clip)) return read_bvh(options.clip);
  return GltfFile(options.clip)
      .clip(options.animation, options.fps > 0.0 ? options.fps : kGltfFramesPerSecond);
}

Motion read_motion(const AnimateCommandOptions& options, const std::optional<GltfFile>& gltf,
                   const RigSkeleton& rig) {
  std::error_code ignored;
  const bool own = options.clip.empty() || std::filesystem::equivalent(options.clip, options.mesh, ignored);
  if (own && options.rig.empty() && gltf) {
    return gltf->motion(options.animation, options.fps > 0.0 ? options.fps : kGltfFramesPerSecond);
  }
  if (options.clip.empty()) {
    throw UnusableInput(options.mesh.string() + ": no motion: give a CLIP (bvh, gltf or glb)");
  }
  Clip clip = read_clip(options);
  if (options.fps > 0.0) clip = resample(clip, options.fps);
  return retarget(clip, rig, {.in_place = options.in_place});
}

Inputs read_inputs(const AnimateCommandOptions& options) {
  Inputs inputs;
  std::optional<GltfFile> gltf;
  if (is_gltf(options.mesh)) {
    gltf.emplace(options.mesh);
    inputs.asset = gltf->mesh();
  } else {
    inputs.asset = read_mesh(options.mesh);
  }
  std::optional<RigSkeleton> rig;
  if (!options.rig.empty()) {
    rig = read_rig(options.rig);
  } else if (gltf) {
    rig = gltf->rig();
  }
  if (!rig) {
    throw UnusableInput(
        options.mesh.string() +
        ": no skeleton in it: give --rig FILE, which says where the joints are (docs/rig-file.md)");
  }
  inputs.rig = std::move(*rig);
  inputs.motion = read_motion(options, gltf, inputs.rig);
  return inputs;
}

bool is_preview(const AnimateCommandOptions& options) {
  return options.mode == "preview";
}

RigOptions rig_options(const AnimateCommandOptions& options) {
  RigOptions rig;
  rig.binding = binding_options(options.deform == "paper" ? Deform::paper : Deform::refined);
  rig.volume.interior = options.interior == "tetgen" ? Interior::tetgen
                        : options.interior == "none" ? Interior::none
                                                     : Interior::lattice;
  rig.volume.density = options.density;
  rig.volume.spacing = options.spacing;
  rig.solver = options.solver == "cholesky" ? SolverKind::cholesky
               : options.solver == "pcg"    ? SolverKind::pcg
                                            : SolverKind::multigrid;
  rig.multigrid.hierarchy.coarsening =
      options.hierarchy == "shi2006" ? Coarsening::shi2006 : Coarsening::lattice;
  if (is_preview(options)) {
    rig.subspace = SubspaceOf::surface;
  } else if (start_named(options.start) == Start::subspace) {
    rig.subspace = SubspaceOf::free_nodes;
  }
  return rig;
}

/// Refuses before any work what could only fail after it.
ExitCode check_output(const AnimateCommandOptions& options) {
  namespace fs = std::filesystem;
  const auto refuse = [](const std::string& text, ExitCode code) {
    std::cerr << "error: " << text << '\n';
    return code;
  };
  const fs::path folder = options.output.has_parent_path() ? options.output.parent_path() : ".";
  if (!fs::is_directory(folder)) {
    return refuse(options.output.string() + ": there is no folder " + folder.string(),
                  ExitCode::input_output);
  }
  std::error_code ignored;
  for (const fs::path& input : {options.mesh, options.clip, options.rig}) {
    if (!input.empty() && fs::equivalent(options.output, input, ignored)) {
      return refuse(options.output.string() + ": is an input of this run; choose another output",
                    ExitCode::usage);
    }
  }
  if (options.format != "obj" && fs::is_directory(options.output)) {
    return refuse(options.output.string() + ": is a folder; expected the name of a .glb file",
                  ExitCode::usage);
  }
  const fs::path first = options.format == "obj" ? numbered(options.output, 1) : options.output;
  if (!fs::exists(first) || options.overwrite == Overwrite::yes) return ExitCode::ok;
  if (options.overwrite == Overwrite::ask && isatty(STDIN_FILENO) != 0) {
    std::cerr << first.string() << " exists. Overwrite? [y/N] " << std::flush;
    std::string answer;
    std::getline(std::cin, answer);
    if (answer == "y" || answer == "Y" || answer == "yes") return ExitCode::ok;
  }
  return refuse(first.string() + ": exists already; -y overwrites it", ExitCode::input_output);
}

void print_warnings(const std::vector<std::string>& warnings, bool quiet) {
  if (quiet) return;
  for (const std::string& warning : warnings) std::cerr << "warning: " << warning << '\n';
}

void take(Report& report, const std::vector<std::string>& warnings, bool quiet) {
  print_warnings(warnings, quiet);
  report.warnings.insert(report.warnings.end(), warnings.begin(), warnings.end());
}

std::string as_text(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

/// Everything the result depends on, as resolved.
std::vector<std::pair<std::string, std::string>> option_records(const AnimateCommandOptions& options,
                                                                const FrameRange& frames, double fps) {
  return {{"animation", options.animation},
          {"frames", std::to_string(frames.first + 1) + "-" + std::to_string(frames.last + 1) + "x" +
                         std::to_string(frames.step)},
          {"fps", as_text(fps)},
          {"in-place", options.in_place ? "true" : "false"},
          {"interior", options.interior},
          {"density", as_text(options.density)},
          {"spacing", as_text(options.spacing)},
          {"deform", options.deform},
          {"mode", options.mode},
          {"solver", options.solver},
          {"hierarchy", options.hierarchy},
          {"tolerance", as_text(options.tolerance)},
          {"start", options.start},
          {"format", options.format},
          {"gltf-tolerance", as_text(options.gltf_tolerance)}};
}

std::vector<InputRecord> input_records(const AnimateCommandOptions& options) {
  std::vector<InputRecord> records;
  for (const auto& [role, path] :
       {std::pair{"mesh", options.mesh}, {"clip", options.clip}, {"rig", options.rig}}) {
    if (!path.empty()) records.push_back(describe_input(role, path));
  }
  return records;
}

SizeRecord sizes_of(const Rig& rig) {
  return {.surface_vertices = rig.mesh.vertex_count(),
          .surface_triangles = static_cast<std::int64_t>(rig.mesh.triangles.size()),
          .graph_nodes = rig.volume.node_count(),
          .free_nodes = static_cast<std::int64_t>(rig.node_of_free.size()),
          .edges = rig.volume.graph.edge_count(),
          .rig_bytes = static_cast<std::int64_t>(rig.bytes())};
}

void print_rig(const Rig& rig) {
  std::cerr << rig.volume.node_count() << " nodes (" << rig.volume.surface_count << " on the surface), "
            << rig.volume.graph.edge_count() << " edges, " << rig.node_of_free.size() << " free; "
            << rig.binding.bones.size() << " bones, " << rig.binding.fields.size() << " fields\n";
  if (const auto* multigrid = dynamic_cast<const MultigridSolver*>(rig.solver.get())) {
    std::cerr << multigrid->hierarchy();
  }
}

/// Where finished frames go.
class FrameSink {
 public:
  FrameSink(const AnimateCommandOptions& options, const MeshAsset& asset, double fps)
      : options_(options), asset_(asset), gltf_(asset, writer_options(options, fps)) {}

  void add(const FrameResult& result) {
    if (is_obj()) {
      write_obj(numbered(options_.output, result.frame + 1), asset_, *result.positions);
    } else {
      gltf_.add_frame(*result.positions);
    }
  }
  bool is_obj() const { return options_.format == "obj"; }
  GltfWriteReport finish() const { return is_obj() ? GltfWriteReport{} : gltf_.write(options_.output); }

 private:
  static GltfWriterOptions writer_options(const AnimateCommandOptions& options, double fps) {
    GltfWriterOptions result;
    result.kind = options.format == "exact" ? GltfKind::exact : GltfKind::pca;
    result.frames_per_second = fps;
    result.tolerance = options.gltf_tolerance;
    return result;
  }

  const AnimateCommandOptions& options_;
  const MeshAsset& asset_;
  GltfWriter gltf_;
};

AnimateOptions solve_options(const AnimateCommandOptions& options, const FrameRange& frames) {
  AnimateOptions result;
  result.mode = is_preview(options) ? FrameMode::preview : FrameMode::full;
  result.frame.deform = options.deform == "paper" ? Deform::paper : Deform::refined;
  result.frame.tolerance = options.tolerance;
  // The frames that previews are measured against stand alone, so where they start hardly matters.
  result.frame.start = is_preview(options) ? Start::automatic : start_named(options.start);
  result.frame.measure_residual = !options.report.empty();
  result.first_frame = frames.first;
  result.last_frame = frames.last;
  return result;
}

/// Solves the frames and hands the wanted ones on. Returns how many those were.
int solve_frames(const Rig& rig, const Motion& motion, const AnimateCommandOptions& options,
                 const FrameRange& frames, ThreadTeam& team, FrameSink& sink, Report& report,
                 Progress& progress) {
  const int wanted = (frames.last - frames.first) / frames.step + 1;
  int done = 0;
  TimingReport timing;
  {
    const auto timer = timing.time("frames");
    animate(rig, motion, solve_options(options, frames), team, [&](const FrameResult& result) {
      if ((result.frame - frames.first) % frames.step == 0) {
        report.frames.push_back(
            {result.frame, result.report, result.volume_ratio, result.farthest_from_skeleton});
        sink.add(result);
        progress.step(++done, wanted);
      }
      return interrupt_asked() == ExitCode::ok;
    });
  }
  report.frames_milliseconds = timing.total();
  return done;
}

}  // namespace

ExitCode run_animate(const AnimateCommandOptions& options) {
  if (const ExitCode refused = check_output(options); refused != ExitCode::ok) return refused;
  const bool quiet = options.common.quiet;
  Report report;
  Progress progress(options.common.progress, quiet);

  progress.stage("reading");
  Inputs inputs;
  {
    const auto timer = report.setup.time("read");
    inputs = read_inputs(options);
    report.inputs = input_records(options);
  }
  take(report, inputs.asset.warnings, quiet);
  take(report, inputs.motion.warnings, quiet);
  FrameRange frames{0, inputs.motion.frame_count() - 1, 1};
  try {
    if (!options.frames.empty())
      frames = resolve(parse_frame_range(options.frames), inputs.motion.frame_count());
  } catch (const std::invalid_argument& error) {
    std::cerr << "error: " << error.what() << '\n';
    return ExitCode::usage;
  }
  const double fps = inputs.motion.frames_per_second / frames.step;
  report.options = option_records(options, frames, fps);

  progress.stage("binding");
  ThreadTeam team(options.threads);
  const Rig rig = build_rig(inputs.asset.mesh, inputs.rig, rig_options(options), team);
  take(report, rig.warnings, quiet);
  for (const auto& [stage, milliseconds] : rig.timing.stages()) report.setup.add(stage, milliseconds);
  report.sizes = sizes_of(rig);
  report.machine = describe_machine(team.thread_count());
  if (options.common.verbose) print_rig(rig);

  if (is_preview(options)) {
    progress.stage("measuring");
    const auto timer = report.setup.time("preview error");
    report.preview = measure_preview(rig, inputs.motion, frames.first, frames.last, kMeasuredPreviews,
                                     solve_options(options, frames).frame, team);
  }

  progress.stage("solving");
  FrameSink sink(options, inputs.asset, fps);
  const int done = solve_frames(rig, inputs.motion, options, frames, team, sink, report, progress);
  if (const ExitCode asked = interrupt_asked(); asked != ExitCode::ok) {
    std::cerr << "interrupted after " << done << " frames; "
              << (sink.is_obj() ? "their files are whole" : "nothing was written") << '\n';
    return asked;
  }

  progress.stage("writing");
  TimingReport writing;
  {
    const auto timer = writing.time("write");
    report.written = sink.finish();
  }
  report.write_milliseconds = writing.total();
  report.output = options.output.string();
  report.peak_memory_bytes = peak_memory();
  if (!options.report.empty()) write_report(options.report, report);
  progress.finish();
  if (!quiet) std::cerr << report;
  return ExitCode::ok;
}

}  // namespace sinew
