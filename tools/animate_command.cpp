#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <optional>

#include "io/bvh.h"
#include "io/file_error.h"
#include "io/gltf_reader.h"
#include "io/gltf_writer.h"
#include "io/mesh_asset.h"
#include "io/obj_writer.h"
#include "io/rig_file.h"
#include "pipeline/animate.h"
#include "skeleton/unusable_input.h"
#include "tools/commands.h"
#include "tools/frame_range.h"
#include "tools/interrupt.h"
#include "tools/output_pattern.h"
#include "tools/progress.h"
#include "tools/run_report.h"

namespace sinew {
namespace {

/// glTF keys lie at any time: sampled at this rate unless --fps says otherwise.
constexpr double kGltfFramesPerSecond = 30.0;

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
    throw UnusableInput(options.mesh.string() +
                        ": no skeleton in it: give --rig FILE, which says where the joints are (docs/rig-file.md)");
  }
  inputs.rig = std::move(*rig);
  inputs.motion = read_motion(options, gltf, inputs.rig);
  return inputs;
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
    return refuse(options.output.string() + ": there is no folder " + folder.string(), ExitCode::input_output);
  }
  std::error_code ignored;
  for (const fs::path& input : {options.mesh, options.clip, options.rig}) {
    if (!input.empty() && fs::equivalent(options.output, input, ignored)) {
      return refuse(options.output.string() + ": is an input of this run; choose another output", ExitCode::usage);
    }
  }
  if (options.format != "obj" && fs::is_directory(options.output)) {
    return refuse(options.output.string() + ": is a folder; expected the name of a .glb file", ExitCode::usage);
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

}  // namespace

ExitCode run_animate(const AnimateCommandOptions& options) {
  if (const ExitCode refused = check_output(options); refused != ExitCode::ok) return refused;
  RunReport report(options);
  Progress progress(options.common.progress, options.common.quiet);

  progress.stage("reading");
  const Inputs inputs = [&] {
    const auto timer = report.timing().time("read");
    return read_inputs(options);
  }();
  print_warnings(inputs.asset.warnings, options.common.quiet);
  print_warnings(inputs.motion.warnings, options.common.quiet);
  report.add_warnings(inputs.asset.warnings);
  report.add_warnings(inputs.motion.warnings);

  FrameRange frames{0, inputs.motion.frame_count() - 1, 1};
  if (!options.frames.empty()) {
    try {
      frames = resolve(parse_frame_range(options.frames), inputs.motion.frame_count());
    } catch (const std::invalid_argument& error) {
      std::cerr << "error: " << error.what() << '\n';
      return ExitCode::usage;
    }
  }

  progress.stage("binding");
  ThreadTeam team(options.threads);
  const Rig rig = build_rig(inputs.asset.mesh, inputs.rig, rig_options(options), team);
  print_warnings(rig.warnings, options.common.quiet);
  report.add_warnings(rig.warnings);
  report.set_rig(rig, team);

  progress.stage("solving");
  AnimateOptions animate_options;
  animate_options.frame.deform = options.deform == "paper" ? Deform::paper : Deform::refined;
  animate_options.frame.solve.tolerance = options.tolerance;
  animate_options.first_frame = frames.first;
  animate_options.last_frame = frames.last;
  const int wanted = (frames.last - frames.first) / frames.step + 1;

  GltfWriterOptions writer_options;
  writer_options.kind = options.format == "exact" ? GltfKind::exact : GltfKind::pca;
  writer_options.frames_per_second = inputs.motion.frames_per_second / frames.step;
  writer_options.tolerance = options.gltf_tolerance;
  GltfWriter writer(inputs.asset, writer_options);

  int written = 0;
  animate(rig, inputs.motion, animate_options, team, [&](const FrameResult& result) {
    if ((result.frame - frames.first) % frames.step == 0) {
      report.add_frame(result);
      if (options.format == "obj") {
        write_obj(numbered(options.output, result.frame + 1), inputs.asset, *result.positions);
      } else {
        writer.add_frame(*result.positions);
      }
      progress.step(++written, wanted);
    }
    return interrupt_asked() == ExitCode::ok;
  });
  if (const ExitCode asked = interrupt_asked(); asked != ExitCode::ok) {
    std::cerr << "interrupted after " << written << " of " << wanted << " frames; "
              << (options.format == "obj" ? "their files are whole" : "nothing written") << '\n';
    return asked;
  }

  if (options.format != "obj") {
    progress.stage("writing");
    const auto timer = report.timing().time("write");
    report.set_output(writer.write(options.output));
  }
  report.write_if_asked();
  progress.stage("done");
  if (!options.common.quiet) report.print_table(std::cerr);
  return ExitCode::ok;
}

}  // namespace sinew
