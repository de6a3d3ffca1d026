// The program as a person meets it: exit codes, one line per error, nothing half-written.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "program.h"

namespace sinew::test {
namespace {

namespace fs = std::filesystem;

const fs::path kOgre = fs::path(SINEW_SOURCE_DIR) / "samples" / "ogre";

std::vector<std::string> ogre_job(const fs::path& output, std::vector<std::string> more) {
  std::vector<std::string> arguments = {"animate", kOgre / "ogre.obj", kOgre / "walk.bvh", "--rig", kOgre / "ogre.toml",
                                        "-o", output, "--progress", "none", "--density", "1"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

long lines(const std::string& text) { return std::count(text.begin(), text.end(), '\n'); }

TEST(Program, wrong_usage_is_one_line_and_exit_2) {
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{}, {"fly"}, {"animate"}, {"animate", "--no-such-flag"}, {"inspect", "a", "b"},
        ogre_job("x.glb", {"--frames", "none"}), ogre_job("x.glb", {"--solver", "magic"}),
        ogre_job("x.glb", {"-y", "-n"}), ogre_job(kOgre / "ogre.obj", {})}) {
    const ProgramRun run = run_sinew(arguments);
    EXPECT_EQ(run.exit_code, 2) << run.errors;
    EXPECT_EQ(lines(run.errors), 1) << run.errors;
    EXPECT_EQ(run.errors.rfind("error: ", 0), 0u) << run.errors;
  }
}

TEST(Program, a_start_nobody_knows_is_refused_with_those_that_are_known) {
  for (const std::vector<std::string>& arguments :
       {ogre_job("x.glb", {"--start", "nonsense"}), {"bench", "frames", "--start", "nonsense"}}) {
    const ProgramRun run = run_sinew(arguments);
    EXPECT_EQ(run.exit_code, 2);
    EXPECT_EQ(run.errors,
              "error: --start: nonsense not in {auto,fischer,linear,previous,quadratic,skinning,subspace,zero}; "
              "see sinew --help\n");
  }
}

TEST(Program, help_lists_only_verbs_that_work) {
  const ProgramRun run = run_sinew({"--help"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_NE(run.output.find("animate"), std::string::npos);
  EXPECT_NE(run.output.find("inspect"), std::string::npos);
  EXPECT_TRUE(run.errors.empty());
}

TEST(Program, a_missing_file_is_exit_5_and_names_it) {
  const ProgramRun run = run_sinew({"inspect", "/nowhere/at/all.obj"});
  EXPECT_EQ(run.exit_code, 5);
  EXPECT_EQ(run.errors, "error: /nowhere/at/all.obj: cannot open: No such file or directory\n");
}

TEST(Program, a_mesh_without_a_skeleton_is_exit_4_and_says_what_helps) {
  const fs::path output = scratch("no-rig") / "a.glb";
  const ProgramRun run = run_sinew({"animate", kOgre / "ogre.obj", kOgre / "walk.bvh", "-o", output, "--progress", "none"});
  EXPECT_EQ(run.exit_code, 4);
  EXPECT_EQ(run.errors, "error: " + (kOgre / "ogre.obj").string() +
                            ": no skeleton in it: give --rig FILE, which says where the joints are (docs/rig-file.md)\n");
  EXPECT_FALSE(fs::exists(output));
}

TEST(Program, a_malformed_clip_is_exit_3_and_leaves_nothing_behind) {
  const fs::path folder = scratch("bad-clip");
  std::ofstream(folder / "bad.bvh") << "HIERARCHY\nROOT hips\n{\n OFFSET 0 0 zero\n";
  const fs::path output = folder / "a.glb";
  const ProgramRun run = run_sinew({"animate", kOgre / "ogre.obj", folder / "bad.bvh", "--rig", kOgre / "ogre.toml", "-o",
                             output, "--progress", "none"});
  EXPECT_EQ(run.exit_code, 3) << run.errors;
  EXPECT_EQ(lines(run.errors), 1) << run.errors;
  EXPECT_NE(run.errors.find("bad.bvh:4:"), std::string::npos) << run.errors;
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), {}), 1);
}

TEST(Program, an_existing_output_is_kept_unless_y) {
  const fs::path output = scratch("exists") / "a.glb";
  std::ofstream(output) << "precious";
  const ProgramRun kept = run_sinew(ogre_job(output, {}));
  EXPECT_EQ(kept.exit_code, 5);
  EXPECT_EQ(kept.errors, "error: " + output.string() + ": exists already; -y overwrites it\n");
  EXPECT_EQ(contents(output), "precious");
  const ProgramRun written = run_sinew(ogre_job(output, {"-y", "--frames", "1-2"}));
  EXPECT_EQ(written.exit_code, 0) << written.errors;
  EXPECT_EQ(contents(output).substr(0, 4), "glTF");
}

TEST(Program, the_report_tells_what_was_done) {
  const fs::path folder = scratch("report");
  const ProgramRun run = run_sinew(ogre_job(folder / "a.glb", {"--frames", "1-5", "--report", folder / "a.json"}));
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const auto report = nlohmann::json::parse(contents(folder / "a.json"));
  EXPECT_EQ(report.at("schema"), "sinew.report/1");
  ASSERT_EQ(report.at("frames").size(), 5u);
  EXPECT_TRUE(report.at("preview").is_null());
  for (const auto& frame : report.at("frames")) {
    EXPECT_TRUE(frame.at("converged").get<bool>());
    EXPECT_LE(frame.at("error").get<double>(), 1e-4);
    EXPECT_GT(frame.at("residual").get<double>(), 0.0);
    EXPECT_NEAR(frame.at("volume_ratio").get<double>(), 1.0, 0.05);
  }
}

TEST(Program, a_preview_says_how_far_it_is_from_solved_frames) {
  const fs::path folder = scratch("preview");
  const ProgramRun run = run_sinew(
      ogre_job(folder / "a.glb", {"--frames", "1-20", "--mode", "preview", "--report", folder / "a.json"}));
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const auto report = nlohmann::json::parse(contents(folder / "a.json"));
  const auto& preview = report.at("preview");
  EXPECT_EQ(preview.at("frames_measured").size(), 9u);
  const double largest = preview.at("largest_error").get<double>();
  EXPECT_GT(largest, preview.at("rms_error").get<double>());
  EXPECT_LT(largest, 0.05);
  for (const auto& frame : report.at("frames")) {
    EXPECT_EQ(frame.at("solves"), 0);
    EXPECT_TRUE(frame.at("error").is_null());
  }
  char told[64];
  std::snprintf(told, sizeof told, "largest error %.1e of the diagonal", largest);
  EXPECT_NE(run.errors.find(told), std::string::npos) << run.errors;
  const ProgramRun started =
      run_sinew(ogre_job(folder / "b.glb", {"--frames", "1-3", "--mode", "preview", "--start", "subspace"}));
  EXPECT_EQ(started.exit_code, 0) << started.errors;
}

TEST(Program, the_same_job_gives_the_same_bytes_for_any_number_of_threads) {
  const fs::path folder = scratch("threads");
  for (const char* threads : {"1", "2", "3"}) {
    const ProgramRun run = run_sinew(ogre_job(folder / (std::string(threads) + ".glb"), {"--frames", "30-36", "-j", threads}));
    ASSERT_EQ(run.exit_code, 0) << run.errors;
  }
  EXPECT_EQ(contents(folder / "1.glb"), contents(folder / "2.glb"));
  EXPECT_EQ(contents(folder / "1.glb"), contents(folder / "3.glb"));
}

TEST(Program, a_range_of_frames_has_the_bytes_of_the_whole_run) {
  const fs::path folder = scratch("range");
  ASSERT_EQ(run_sinew(ogre_job(folder / "whole_####.obj", {"--format", "obj", "--frames", "1-70"})).exit_code, 0);
  ASSERT_EQ(run_sinew(ogre_job(folder / "part_####.obj", {"--format", "obj", "--frames", "66-70x2"})).exit_code, 0);
  for (const char* frame : {"0066", "0068", "0070"}) {
    const std::string part = contents(folder / ("part_" + std::string(frame) + ".obj"));
    EXPECT_FALSE(part.empty());
    EXPECT_EQ(part, contents(folder / ("whole_" + std::string(frame) + ".obj"))) << frame;
  }
  EXPECT_FALSE(fs::exists(folder / "part_0067.obj"));
}

TEST(Program, every_solver_and_interior_animates_the_sample) {
  const fs::path folder = scratch("solvers");
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{"--solver", "cholesky"}, {"--solver", "pcg"}, {"--hierarchy", "shi2006"},
        {"--interior", "none"}, {"--interior", "tetgen"}, {"--deform", "paper"}, {"--format", "exact"}}) {
    std::vector<std::string> arguments = ogre_job(folder / "a.glb", {"-y", "--frames", "20-22"});
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramRun run = run_sinew(arguments);
    EXPECT_EQ(run.exit_code, 0) << more[1] << ": " << run.errors;
  }
}

TEST(Program, a_config_file_sets_options_and_unknown_keys_are_errors) {
  const fs::path folder = scratch("config");
  std::ofstream(folder / "good.toml") << "[animate]\nframes = \"1-2\"\ndeform = \"paper\"\n";
  std::ofstream(folder / "bad.toml") << "[animate]\nframez = \"1-2\"\n";
  std::vector<std::string> job = ogre_job(folder / "a.glb", {"-y"});
  job.insert(job.begin(), {"--config", folder / "good.toml"});
  EXPECT_EQ(run_sinew(job).exit_code, 0);
  job[1] = folder / "bad.toml";
  const ProgramRun run = run_sinew(job);
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.errors.find("framez"), std::string::npos) << run.errors;
}

TEST(Program, inspect_prints_a_table_or_json) {
  const ProgramRun table = run_sinew({"inspect", kOgre / "ogre.obj"});
  EXPECT_EQ(table.exit_code, 0);
  EXPECT_NE(table.output.find("closed"), std::string::npos);
  const auto mesh = nlohmann::json::parse(run_sinew({"inspect", "--json", kOgre / "ogre.obj"}).output);
  EXPECT_TRUE(mesh.at("mesh").at("closed").get<bool>());
  EXPECT_EQ(mesh.at("mesh").at("components"), 1);
  const auto clip = nlohmann::json::parse(run_sinew({"inspect", "--json", kOgre / "walk.bvh"}).output);
  EXPECT_EQ(clip.at("motion").at("joints"), 22);
  EXPECT_EQ(clip.at("motion").at("roles").size(), 22u);
}

/// Every file that others have collected to break readers gives a result or one error line and exit
/// code 3 or 4, in under 2 seconds and 300 MB.
TEST(Program, bad_files_end_in_a_result_or_one_line) {
  const fs::path bad = fs::path(SINEW_SHARED_DATA) / "bad";
  if (!fs::exists(bad)) GTEST_SKIP() << "no test data at " << bad;
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(bad)) {
    const std::string extension = entry.path().extension();
    if (!entry.is_regular_file() || extension == ".bin" || extension == ".tsv") continue;
    ++files;
    const ProgramRun run = run_sinew({"inspect", entry.path()});
    SCOPED_TRACE(entry.path().string() + "\n" + run.errors);
    EXPECT_EQ(run.signal, 0);
    EXPECT_TRUE(run.exit_code == 0 || run.exit_code == 3 || run.exit_code == 4) << run.exit_code;
    EXPECT_EQ(lines(run.errors), run.exit_code == 0 ? 0 : 1);
    EXPECT_LT(run.peak_kilobytes, 300'000);
    EXPECT_LT(run.seconds, 2.0);  // the bound that users were promised, not a benchmark
  }
  EXPECT_GT(files, 50);
}

}  // namespace
}  // namespace sinew::test
