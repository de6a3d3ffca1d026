// `sinew bench` as a person runs it.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "program.h"

namespace sinew::test {
namespace {

namespace fs = std::filesystem;

long lines(const std::string& text) {
  return std::count(text.begin(), text.end(), '\n');
}

TEST(Bench, wrong_usage_is_one_line_and_exit_2) {
  for (const std::vector<std::string>& arguments : {std::vector<std::string>{"bench"},
                                                    {"bench", "fast"},
                                                    {"bench", "solver", "--sizes", "0"},
                                                    {"bench", "solver", "--sizes", "many"},
                                                    {"bench", "solver", "--mesh", "unicorn"},
                                                    {"bench", "solver", "--solvers", "magic"},
                                                    {"bench", "solver", "--repeats", "0"},
                                                    {"bench", "solver", "--threads", "0"},
                                                    {"bench", "frames", "--size", "0"},
                                                    {"bench", "frames", "--mesh", "ogre,koala"},
                                                    {"bench", "frames", "--frames", "none"},
                                                    {"bench", "frames", "--frames", "1-9x2"},
                                                    {"bench", "frames", "--frames", "5000-"},
                                                    {"bench", "frames", "--deform", "best"},
                                                    {"bench", "frames", "--max-slowdown", "0.9"}}) {
    const ProgramRun run = run_sinew(arguments);
    EXPECT_EQ(run.exit_code, 2) << run.errors;
    EXPECT_EQ(lines(run.errors), 1) << run.errors;
    EXPECT_EQ(run.errors.rfind("error: ", 0), 0u) << run.errors;
  }
}

TEST(Bench, a_mesh_that_is_not_there_is_exit_4) {
  const ProgramRun run =
      run_sinew({"bench", "solver", "--mesh", "koala", "--data", "/nowhere", "--progress", "none"});
  EXPECT_EQ(run.exit_code, 4);
  EXPECT_NE(run.errors.find("--data says where it is"), std::string::npos) << run.errors;
}

TEST(Bench, every_solver_found_solves_the_same_system) {
  const fs::path folder = scratch("bench-solver");
  const ProgramRun run = run_sinew({"bench", "solver", "--mesh", "ogre", "--sizes", "25000", "--repeats", "1",
                                    "--rounds", "1", "--progress", "none", "--json", folder / "a.json",
                                    "--markdown", folder / "a.md", "--plot", folder / "a.svg"});
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const auto root = nlohmann::json::parse(contents(folder / "a.json"));
  EXPECT_GT(root.at("read_bandwidth_gbs").get<double>(), 0.0);
  ASSERT_EQ(root.at("systems").size(), 1u);
  const auto& system = root.at("systems")[0];
  EXPECT_EQ(system.at("name"), "ogre");
  EXPECT_NEAR(system.at("free_vertices").get<double>(), 25000, 2500);
  for (const char* name : {"sinew", "shi2006", "cholmod", "eigen_pcg"}) {
    EXPECT_TRUE(system.at("solvers").contains(name)) << name;
  }
  for (const auto& [name, solver] : system.at("solvers").items()) {
    ASSERT_FALSE(solver.contains("failure")) << name << ": " << solver.at("failure");
    EXPECT_LE(solver.at("residual").at("1e-3").get<double>(), 1e-3) << name;
    EXPECT_LE(solver.at("residual").at("1e-5").get<double>(), 1e-5) << name;
    EXPECT_LE(solver.at("vertex_error").at("1e-5").get<double>(), 1e-3) << name;
    EXPECT_GT(solver.at("memory_mb").get<double>(), 0.0) << name;
    EXPECT_GT(solver.at("setup_s").get<double>(), 0.0) << name;
    EXPECT_GT(solver.at("to_1e-3_s").get<double>(), 0.0) << name;
  }
  EXPECT_EQ(system.at("solvers").at("sinew").at("iterations").at("1e-3"), 1);
  EXPECT_EQ(contents(folder / "a.svg").rfind("<svg ", 0), 0u);
  const std::string page = contents(folder / "a.md");
  EXPECT_EQ(page.rfind("<!-- sinew bench solver -->\n", 0), 0u);
  EXPECT_NE(page.find("| sinew |"), std::string::npos);
}

std::vector<std::string> small_frames(std::vector<std::string> more) {
  std::vector<std::string> arguments = {"bench", "frames",    "--size", "25000",      "--frames",
                                        "20-29", "--repeats", "3",      "--progress", "none"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

TEST(Bench, frames_are_measured_kept_and_compared_with) {
  const fs::path folder = scratch("bench-frames");
  const fs::path kept = folder / "base.json";
  const ProgramRun first =
      run_sinew(small_frames({"--save", kept, "--json", folder / "a.json", "--markdown", folder / "a.md"}));
  ASSERT_EQ(first.exit_code, 0) << first.errors;
  const auto root = nlohmann::json::parse(contents(folder / "a.json"));
  EXPECT_GT(root.at("read_bandwidth_gbs").get<double>(), 0.0);
  const auto& frame = root.at("frame");
  EXPECT_LE(frame.at("median_ms").get<double>(), frame.at("p95_ms").get<double>());
  EXPECT_LE(frame.at("p95_ms").get<double>(), frame.at("p99_ms").get<double>());
  EXPECT_GT(frame.at("cholesky_median_ms").get<double>(), 0.0);
  EXPECT_FALSE(root.at("stages").empty());
  EXPECT_EQ(root.at("samples").size(), 3u);
  EXPECT_NE(contents(folder / "a.md").find("| whole frame |"), std::string::npos);

  // Time may do what it likes here: what is compared exactly is what can be counted.
  const ProgramRun second =
      run_sinew(small_frames({"--no-cholesky", "--against", kept, "--max-slowdown", "100"}));
  EXPECT_EQ(second.exit_code, 0) << second.output << second.errors;
  EXPECT_NE(second.output.find("time over the baseline's"), std::string::npos) << second.output;

  auto baseline = nlohmann::json::parse(contents(kept));
  baseline["counters"]["cycles"] = baseline["counters"]["cycles"].get<int>() - 1;
  std::ofstream(folder / "better.json") << baseline;
  const ProgramRun slower = run_sinew(
      small_frames({"--no-cholesky", "--against", folder / "better.json", "--max-slowdown", "100"}));
  EXPECT_EQ(slower.exit_code, 4);
  EXPECT_EQ(slower.errors, "error: slower than the baseline\n");
  EXPECT_NE(slower.output.find("more cycles: "), std::string::npos) << slower.output;

  const ProgramRun other = run_sinew(small_frames({"--no-cholesky", "--against", kept, "--deform", "paper"}));
  EXPECT_EQ(other.exit_code, 4);
  EXPECT_EQ(lines(other.errors), 1) << other.errors;
  EXPECT_NE(other.errors.find("the baseline was measured with"), std::string::npos) << other.errors;
}

TEST(Bench, what_could_only_fail_at_the_end_is_refused_at_the_beginning) {
  const ProgramRun folder = run_sinew({"bench", "frames", "--save", "/nowhere/at/all.json"});
  EXPECT_EQ(folder.exit_code, 5);
  EXPECT_EQ(folder.errors, "error: /nowhere/at/all.json: there is no folder /nowhere/at\n");
  const ProgramRun baseline = run_sinew({"bench", "frames", "--against", "/nowhere/at/all.json"});
  EXPECT_EQ(baseline.exit_code, 5);
  EXPECT_EQ(lines(baseline.errors), 1) << baseline.errors;
}

TEST(Bench, a_solver_over_its_limit_is_reported_as_not_finished) {
  const fs::path folder = scratch("bench-limit");
  const ProgramRun run =
      run_sinew({"bench", "solver", "--mesh", "ogre", "--sizes", "60000", "--solvers", "cholmod",
                 "--limit-seconds", "1", "--progress", "none", "--json", folder / "a.json"});
  ASSERT_EQ(run.exit_code, 0) << run.errors;
  const auto root = nlohmann::json::parse(contents(folder / "a.json"));
  const std::string failure = root.at("systems")[0].at("solvers").at("cholmod").at("failure");
  EXPECT_EQ(failure.rfind("not finished within 1 s", 0), 0u) << failure;
}

}  // namespace
}  // namespace sinew::test
