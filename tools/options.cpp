#include "tools/options.h"

#include <CLI/CLI.hpp>
#include <iostream>
#include <map>
#include <string>

#include "tools/commands.h"
#include "tools/frame_range.h"
#include "tools/start_names.h"
#include "tools/version.h"

namespace sinew {
namespace {

constexpr const char* kExitCodeText =
    "Exit codes: 0 ok, 1 failed, 2 usage, 3 malformed input, 4 input that cannot be used,\n"
    "5 input/output error, 6 resource limit, 70 internal error, 130/143 interrupted.";

const std::map<std::string, ProgressStyle> kProgressStyles = {{"auto", ProgressStyle::automatic},
                                                              {"bar", ProgressStyle::bar},
                                                              {"plain", ProgressStyle::plain},
                                                              {"json", ProgressStyle::json},
                                                              {"none", ProgressStyle::none}};

/// For verbs that have nothing more to say when asked.
void add_quiet_and_progress(CLI::App& verb, CommonOptions& common) {
  verb.add_flag("-q,--quiet", common.quiet, "Print errors only");
  verb.add_option("--progress", common.progress, "auto, bar, plain, json or none")
      ->transform(CLI::CheckedTransformer(kProgressStyles, CLI::ignore_case).description(""));
}

void add_common(CLI::App& verb, CommonOptions& common) {
  add_quiet_and_progress(verb, common);
  verb.add_flag("-v,--verbose", common.verbose, "Print what each stage found");
}

CLI::Validator one_of(std::vector<std::string> names) {
  return CLI::IsMember(std::move(names)).description("");
}

void add_animate(CLI::App& app, AnimateCommandOptions& options, bool& yes, bool& no) {
  CLI::App* verb = app.add_subcommand("animate", "Animate a mesh with a motion capture clip");
  verb->add_option("MESH", options.mesh, "Mesh: obj, ply, off, stl, gltf or glb")->required();
  verb->add_option("CLIP", options.clip, "Motion: bvh, gltf or glb (default: the mesh file's own animation)");
  verb->add_option("-o,--output", options.output,
                   "File to write: .glb, or .obj with #### for the frame number")
      ->required();
  verb->add_flag("-y,--yes", yes, "Overwrite the output");
  verb->add_flag("-n,--no", no, "Never overwrite");
  verb->add_option("--rig", options.rig, "Rig file (TOML): where the joints are inside the mesh");
  verb->add_option("--animation", options.animation, "Animation of a glTF clip: name or number from 0");
  verb->add_option("--frames", options.frames, "Frames to solve: 12, 1-100, 1-100x5; -1 is the last");
  verb->add_option("--fps", options.fps, "Resample the clip to this rate (default: its own; glTF 30)")
      ->check(CLI::Range(0.1, 10000.0).description(""));
  verb->add_flag("--in-place", options.in_place, "Keep the body above its starting point");
  verb->add_option("--interior", options.interior, "What fills the body: lattice, tetgen or none")
      ->check(one_of({"lattice", "tetgen", "none"}));
  verb->add_option("--density", options.density, "Interior nodes per surface vertex (default: from the mesh)")
      ->check(CLI::Range(0.01, 1000.0).description(""));
  verb->add_option("--spacing", options.spacing,
                   "Spacing of the interior lattice in mesh units, instead of --density")
      ->check(CLI::PositiveNumber.description(""));
  verb->add_option("--mode", options.mode, "full, or preview: from a linear subspace, unsolved, error measured")
      ->check(one_of({"full", "preview"}));
  verb->add_option("--deform", options.deform, "refined, or paper for Shi 2006 as published")
      ->check(one_of({"refined", "paper"}));
  verb->add_option("--solver", options.solver, "multigrid, cholesky or pcg")
      ->check(one_of({"multigrid", "cholesky", "pcg"}));
  verb->add_option("--hierarchy", options.hierarchy, "Of the multigrid: lattice or shi2006")
      ->check(one_of({"lattice", "shi2006"}));
  verb->add_option("--tolerance", options.tolerance,
                   "Largest error of any vertex, as a share of the body's diagonal, estimated")
      ->check(CLI::Range(1e-14, 1.0).description(""))
      ->capture_default_str();
  verb->add_option("--start", options.start,
                   "Where a frame's solve begins: auto, zero, previous, linear, quadratic, skinning,\n"
                   "subspace or fischer")
      ->check(one_of(start_names()));
  verb->add_option("--format", options.format,
                   "pca (few morph targets), exact (one per frame) or obj (a file per frame)")
      ->check(one_of({"pca", "exact", "obj"}));
  verb->add_option("--gltf-tolerance", options.gltf_tolerance,
                   "pca: error allowed, as a share of the body's diagonal")
      ->check(CLI::Range(1e-7, 0.5).description(""))
      ->capture_default_str();
  verb->add_option("-j,--threads", options.threads,
                   "Threads (default: all); the result is the same for any number")
      ->check(CLI::Range(1, 1024).description(""));
  verb->add_option("--report", options.report, "Write timings and solver figures as JSON");
  add_common(*verb, options.common);
}

void add_inspect(CLI::App& app, InspectOptions& options) {
  CLI::App* verb = app.add_subcommand("inspect", "Print what is in a mesh or motion file");
  verb->add_option("FILE", options.file, "obj, ply, off, stl, gltf, glb or bvh")->required();
  verb->add_flag("--json", options.json, "Print JSON instead of a table");
}

void add_bench_common(CLI::App& verb, BenchOptions& options) {
  verb.add_option("--mesh", options.meshes,
                  "Body: ogre, armadillo, armadillo_loop2, human_man, camel, koala (default: all)")
      ->delimiter(',')
      ->check(one_of({"ogre", "armadillo", "armadillo_loop2", "human_man", "camel", "koala"}));
  verb.add_option("--data", options.data, "Folder of the meshes (all but the ogre, which is a sample)")
      ->envname("SINEW_SHARED_DATA");
  verb.add_option("--samples", options.samples,
                  "Folder of the ogre and the rig files (default: samples of the source)");
  verb.add_option("--json", options.json, "Write every number as JSON");
  verb.add_option("--markdown", options.markdown, "Put the tables into this page, between its markers");
  verb.add_option("-j,--threads", options.threads, "Threads (default: all)")
      ->check(CLI::Range(1, 1024).description(""));
  verb.add_option("--limit-seconds", options.limit_seconds, "Longest a solver may take on one system")
      ->check(CLI::Range(1.0, 86400.0).description(""))
      ->capture_default_str();
  verb.add_option("--limit-gigabytes", options.limit_gigabytes, "Most memory a solver may take")
      ->check(CLI::Range(0.5, 4096.0).description(""))
      ->capture_default_str();
  add_quiet_and_progress(verb, options.common);
}

void add_bench_solver(CLI::App& bench, BenchSolverOptions& options) {
  CLI::App* verb =
      bench.add_subcommand("solver", "One frame's system, by our multigrid and by every other solver found");
  add_bench_common(*verb, options);
  options.sizes = {100000, 500000};
  verb->add_option("--sizes", options.sizes, "Free vertices wanted (within 10 %), with commas between")
      ->delimiter(',')
      ->check(CLI::Range(1000, 20000000).description(""))
      ->capture_default_str();
  verb->add_option("--repeats", options.repeats, "Times each measurement is repeated; medians are shown")
      ->check(CLI::Range(1, 1000).description(""))
      ->capture_default_str();
  verb->add_option("--plot", options.plot, "Draw time and memory against size, as SVG");
  verb->add_option("--rounds", options.rounds, "Turns every solver takes, with the others in between")
      ->check(CLI::Range(1, 1000).description(""))
      ->capture_default_str();
  verb->add_option("--solvers", options.solvers,
                   "Only these: sinew, shi2006, cholmod, hypre, trilinos_ml, amgcl, eigen_pcg")
      ->delimiter(',')
      ->check(one_of({"sinew", "shi2006", "cholmod", "hypre", "trilinos_ml", "amgcl", "eigen_pcg"}));
}

void add_bench_frames(CLI::App& bench, BenchFramesOptions& options) {
  CLI::App* verb =
      bench.add_subcommand("frames", "A clip frame by frame, stage by stage; compared with an earlier run");
  add_bench_common(*verb, options);
  verb->get_option("--mesh")->expected(1)->description(
      "Body: ogre (default), armadillo, armadillo_loop2, human_man, camel, koala");
  verb->add_option("--size", options.size, "Free vertices wanted (within 10 %)")
      ->check(CLI::Range(1000, 20000000).description(""))
      ->capture_default_str();
  verb->add_option("--clip", options.clip, "Motion: bvh (default: the sample's walk)");
  verb->add_option("--frames", options.frames, "Frames to run, as 1-100 (default: all)");
  verb->add_option("--deform", options.deform, "refined, or paper for Shi 2006 as published")
      ->check(one_of({"refined", "paper"}))
      ->capture_default_str();
  verb->add_option("--tolerance", options.tolerance,
                   "Largest error of any vertex, as a share of the diagonal")
      ->check(CLI::Range(1e-14, 1.0).description(""))
      ->capture_default_str();
  verb->add_option("--start", options.start, "Where a frame's solve begins, as in animate")
      ->check(one_of(start_names()))
      ->capture_default_str();
  verb->add_option("--repeats", options.repeats,
                   "Runs over the frames; a frame's time is the median over them")
      ->check(CLI::Range(1, 1000).description(""))
      ->capture_default_str();
  verb->add_flag("!--no-cholesky", options.cholesky, "Without CHOLMOD beside it");
  verb->add_flag("--check-errors", options.check_errors,
                 "Compare every frame with a tight solve: is what it says of its error true?");
  verb->add_option("--save", options.save, "Keep this run's times and counts, for --against");
  verb->add_option("--against", options.against, "Compare with a kept run; exit code 4 when this one is slower");
  verb->add_option("--max-slowdown", options.max_slowdown, "Time over the kept run's that is still allowed")
      ->check(CLI::Range(1.0, 100.0).description(""))
      ->capture_default_str();
}

}  // namespace

ExitCode run_command_line(int argc, char** argv) {
  CLI::App app{"Animates a base mesh with motion capture, no weights to paint.", "sinew"};
  app.footer(kExitCodeText);
  app.set_version_flag("--version", std::string("sinew ") + kVersion);
  app.set_config("--config", "", "TOML file with options, a [section] per verb; unknown keys are errors");
  app.allow_config_extras(CLI::config_extras_mode::error);
  app.require_subcommand(1);

  AnimateCommandOptions animate;
  InspectOptions inspect;
  BenchSolverOptions bench_solver;
  BenchFramesOptions bench_frames;
  bool yes = false;
  bool no = false;
  add_animate(app, animate, yes, no);
  add_inspect(app, inspect);
  CLI::App* bench = app.add_subcommand("bench", "Measure how fast it is");
  bench->require_subcommand(1);
  add_bench_solver(*bench, bench_solver);
  add_bench_frames(*bench, bench_frames);

  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& wanted) {  // --help and --version
    app.exit(wanted);
    return ExitCode::ok;
  } catch (const CLI::ParseError& error) {
    std::cerr << "error: " << error.what() << "; see sinew --help\n";
    return ExitCode::usage;
  }
  try {
    if (yes && no) throw std::invalid_argument("-y and -n exclude each other");
    animate.overwrite = yes ? Overwrite::yes : no ? Overwrite::no : Overwrite::ask;
    for (const std::string& frames : {animate.frames, bench_frames.frames}) {
      if (!frames.empty()) parse_frame_range(frames);
    }
  } catch (const std::invalid_argument& error) {
    std::cerr << "error: " << error.what() << "; see sinew --help\n";
    return ExitCode::usage;
  }
  if (app.got_subcommand("animate")) return run_animate(animate);
  if (app.got_subcommand("inspect")) return run_inspect(inspect);
  return bench->got_subcommand("solver") ? run_bench_solver(bench_solver) : run_bench_frames(bench_frames);
}

}  // namespace sinew
