#include "io/report.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <sstream>

#include "io/sha256.h"

namespace sinew {
namespace {

std::string sha256_of(const std::string& text) {
  return sha256(std::as_bytes(std::span(text)));
}

TEST(Sha256, gives_the_digests_of_the_standard) {
  EXPECT_EQ(sha256_of(""), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(sha256_of("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(sha256_of("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq"),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
  EXPECT_EQ(sha256_of(std::string(1'000'000, 'a')),
            "cdc76e5c9914fb9281a1c7e284d73e67f1809a48a497200e046d39ccc7112cd0");
}

TEST(Sha256, pads_every_length_around_a_block_differently) {
  std::vector<std::string> seen;
  for (std::size_t length = 54; length < 67; ++length) seen.push_back(sha256_of(std::string(length, 'x')));
  std::ranges::sort(seen);
  EXPECT_EQ(std::ranges::adjacent_find(seen), seen.end());
}

TEST(Spread, takes_the_nearest_rank) {
  std::vector<double> values;
  for (int i = 100; i >= 1; --i) values.push_back(i);
  const Spread spread = spread_of(values);
  EXPECT_EQ(spread.median, 50.0);
  EXPECT_EQ(spread.p95, 95.0);
  EXPECT_EQ(spread.p99, 99.0);
  EXPECT_EQ(spread.max, 100.0);
  EXPECT_EQ(spread_of({7.0}).median, 7.0);
  EXPECT_EQ(spread_of({}).max, 0.0);
}

Report sample_report() {
  Report report;
  report.inputs.push_back({"mesh", "ogre.obj", 12, sha256_of("abc")});
  report.options = {{"deform", "refined"}, {"tolerance", "0.001"}};
  report.machine = {.processor = "test", .hardware_threads = 4, .threads = 2, .native = true};
  report.warnings = {"W_BVH_EXTRA_ROWS: 3070 rows, 3069 frames"};
  report.setup.add("volume graph", 100.0);
  report.setup.add("hierarchy", 50.0);
  report.sizes = {.surface_vertices = 10, .graph_nodes = 30, .free_nodes = 20, .edges = 90};
  for (int frame = 0; frame < 4; ++frame) {
    FrameRecord record;
    record.frame = frame;
    record.volume_ratio = 1.0 - 0.01 * frame;
    record.report.cycles = 3 + frame;
    record.report.solves = 2;
    record.report.residual = 1e-4 * frame;
    record.report.error = 1e-5 * frame;
    record.report.converged = frame != 2;
    record.report.milliseconds.fill(1.0 + frame);
    report.frames.push_back(record);
  }
  report.frames_milliseconds = 20.0;
  report.output = "ogre.glb";
  report.written.bytes = 5'000'000;
  return report;
}

TEST(Report, says_in_json_what_was_measured) {
  const auto json = nlohmann::json::parse(report_json(sample_report()));
  EXPECT_EQ(json["schema"], "sinew.report/1");
  EXPECT_EQ(json["tool"]["name"], "sinew");
  EXPECT_EQ(json["inputs"][0]["sha256"], sha256_of("abc"));
  EXPECT_EQ(json["options"]["deform"], "refined");
  EXPECT_EQ(json["machine"]["threads"], 2);
  EXPECT_EQ(json["warnings"].size(), 1U);
  EXPECT_EQ(json["setup"]["total_ms"], 150.0);
  EXPECT_EQ(json["setup"]["stages_ms"]["hierarchy"], 50.0);
  EXPECT_EQ(json["sizes"]["free_nodes"], 20);
  EXPECT_EQ(json["frames"].size(), 4U);
  EXPECT_EQ(json["frames"][3]["cycles"], 6);
  EXPECT_EQ(json["frames"][3]["ms"]["total"], 4.0 * (kFrameStageCount - 1));
  EXPECT_EQ(json["summary"]["ms"]["total"]["max"], 4.0 * (kFrameStageCount - 1));
  EXPECT_EQ(json["summary"]["ms"]["solve"]["median"], 2.0);
  EXPECT_EQ(json["summary"]["unconverged_frames"], std::vector<int>{2});
  EXPECT_DOUBLE_EQ(json["summary"]["worst_residual"].get<double>(), 3e-4);
  EXPECT_DOUBLE_EQ(json["summary"]["volume_ratio"]["min"].get<double>(), 0.97);
  EXPECT_DOUBLE_EQ(json["summary"]["worst_error"].get<double>(), 3e-5);
  EXPECT_EQ(json["summary"]["frames_per_second"], 200.0);
  EXPECT_EQ(json["output"]["bytes"], 5'000'000);
}

TEST(Report, an_empty_run_is_still_a_whole_document) {
  const auto json = nlohmann::json::parse(report_json({}));
  EXPECT_EQ(json["frames"].size(), 0U);
  EXPECT_TRUE(json["output"].is_null());
}

TEST(Report, numbers_that_are_not_finite_become_null) {
  Report report = sample_report();
  report.frames[1].volume_ratio = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(nlohmann::json::parse(report_json(report))["frames"][1]["volume_ratio"].is_null());
}

TEST(Report, prints_a_short_table) {
  std::ostringstream table;
  table << sample_report();
  const std::string text = table.str();
  EXPECT_NE(text.find("frames   4 in 0.02 s, 200.0 a second, 2 threads"), std::string::npos) << text;
  EXPECT_NE(text.find("largest error 3.0e-05 of the diagonal (estimate); 1 frames short of the tolerance"), std::string::npos) << text;
  EXPECT_NE(text.find("volume   97.0 % to 100.0 % of rest"), std::string::npos) << text;
  for (const char c : text) EXPECT_TRUE(c == '\n' || (c >= ' ' && c < 127));
}

TEST(Report, is_written_whole_and_names_its_inputs) {
  const auto path = std::filesystem::path(testing::TempDir()) /
                    ("sinew_report_test_" + std::to_string(::getpid()) + ".json");
  write_report(path, sample_report());
  std::ifstream file(path);
  const std::string text(std::istreambuf_iterator<char>(file), {});
  EXPECT_EQ(text, report_json(sample_report()));
  const InputRecord input = describe_input("report", path);
  EXPECT_EQ(input.bytes, static_cast<std::int64_t>(text.size()));
  EXPECT_EQ(input.sha256, sha256_of(text));
  std::filesystem::remove(path);
}

TEST(Machine, is_described) {
  const MachineRecord machine = describe_machine(3);
  EXPECT_FALSE(machine.processor.empty());
  EXPECT_EQ(machine.threads, 3);
  EXPECT_GT(peak_memory(), 1'000'000);
}

}  // namespace
}  // namespace sinew
