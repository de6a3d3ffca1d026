// The parts of `sinew bench`: systems of real frames, tables, pages.
#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "pipeline/frame_solver.h"
#include "samples/ogre_motion.h"
#include "skeleton/retarget.h"
#include "skeleton/unusable_input.h"
#include "solver/cholesky.h"
#include "tools/bench/bench_files.h"
#include "tools/bench/posed_system.h"
#include "tools/bench/scenes.h"
#include "tools/bench/svg_plot.h"
#include "tools/bench/table.h"

namespace sinew {
namespace {

namespace fs = std::filesystem;

constexpr int kFreeNodes = 25000;
const SceneFolders kFolders = {"/nowhere", fs::path(SINEW_SOURCE_DIR) / "samples"};

/// The ogre mid-stride, in the paper's form.
struct Walking {
  Walking()
      : scene(load_scene("ogre", kFolders)),
        motion(retarget(samples::walk_clip(), scene.skeleton)),
        rig(build_rig_of_size(scene, kFreeNodes, Deform::paper, team)),
        posed(pose_system(rig, pose(), "ogre", team)) {}
  const Pose& pose() const { return motion.poses[20]; }

  ThreadTeam team{2};
  Scene scene;
  Motion motion;
  Rig rig;
  PosedSystem posed;
};

const Walking& walking() {
  static const Walking kWalking;
  return kWalking;
}

fs::path temporary(const std::string& name) {
  return fs::temp_directory_path() / ("sinew-bench-test-" + std::to_string(getpid()) + "-" + name);
}

std::string text_of(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

TEST(Scenes, a_rig_has_as_many_free_nodes_as_asked_for) {
  EXPECT_NEAR(walking().posed.size(), kFreeNodes, 0.1 * kFreeNodes);
}

TEST(Scenes, a_size_below_the_surface_is_refused) {
  ThreadTeam team(1);
  try {
    build_rig_of_size(walking().scene, 2000, Deform::paper, team);
    FAIL() << "built";
  } catch (const UnusableInput& error) {
    EXPECT_EQ(error.what(), "ogre with 2000 free nodes: its surface alone has " +
                                std::to_string(walking().scene.mesh.vertex_count()));
  }
}

TEST(Scenes, a_mesh_that_is_not_there_names_the_option_that_helps) {
  try {
    load_scene("koala", kFolders);
    FAIL() << "loaded";
  } catch (const UnusableInput& error) {
    EXPECT_STREQ(error.what(),
                 "koala: there is no /nowhere/meshes/odedstein/koala.obj; --data says where it is");
  }
  EXPECT_FALSE(scene_exists("koala", kFolders));
  EXPECT_TRUE(scene_exists("ogre", kFolders));
}

TEST(PosedSystem, is_what_a_frame_solves) {
  const Walking& w = walking();
  FrameOptions options;
  options.deform = Deform::paper;
  options.tolerance = 1e-6;
  FrameSolver frame(w.rig, options, const_cast<ThreadTeam&>(w.team));
  frame.solve(w.pose());
  Field3 positions(w.rig.volume.node_count(), 3);
  frame.read_positions(positions);
  const CholeskySolver direct(w.posed.system);
  Columns x = Columns::Zero(w.posed.size(), 3);
  direct.solve(w.posed.b, x, {}, *direct.make_workspace(3));
  EXPECT_LT(vertex_error(w.posed, x), 1e-8);
  double worst = 0.0;
  for (int free = 0; free < w.posed.size(); ++free) {
    const Eigen::RowVector3d placed =
        positions.row(w.rig.node_of_free[free]) - w.pose().positions.front().transpose();
    worst = std::max(worst, (placed - x.row(free)).norm());
  }
  EXPECT_LT(worst / w.posed.diagonal, 1e-5);  // a frame handles its edges in single precision
}

TEST(PosedSystem, its_edge_targets_add_up_to_its_right_hand_side) {
  const PosedSystem& posed = walking().posed;
  const EdgeTargets targets = edge_targets(posed);
  Columns sum = targets.beta;
  const Graph& graph = posed.system.graph;
  for (int i = 0; i < posed.size(); ++i)
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
      sum.row(i) += graph.weights[k] * targets.wanted.row(k);
  EXPECT_LT((sum - posed.b).norm(), 1e-6 * posed.b.norm());
}

TEST(PosedSystem, comes_back_from_its_file_as_it_was) {
  const PosedSystem& posed = walking().posed;
  const fs::path file = temporary("system");
  write_posed_system(file, posed);
  const PosedSystem back = read_posed_system(file);
  EXPECT_EQ(back.name, posed.name);
  EXPECT_EQ(back.system.graph.neighbors, posed.system.graph.neighbors);
  EXPECT_EQ(back.system.anchor, posed.system.anchor);
  EXPECT_EQ(back.b, posed.b);
  EXPECT_EQ(back.exact, posed.exact);
  EXPECT_EQ(back.turns.back(), posed.turns.back());
  fs::resize_file(file, fs::file_size(file) - 1);
  EXPECT_THROW(read_posed_system(file), std::runtime_error);
  fs::resize_file(file, 5);
  EXPECT_THROW(read_posed_system(file), std::runtime_error);
  fs::remove(file);
}

TEST(Table, has_words_to_the_left_and_numbers_to_the_right) {
  const Table table{"Times", {"solver", "s"}, {{"ours", "1.5"}, {"other one", "12"}}};
  EXPECT_EQ(to_text(table), "Times\nsolver       s\nours       1.5\nother one   12\n");
  EXPECT_EQ(to_markdown(table),
            "**Times**\n\n| solver | s |\n|---|---:|\n| ours | 1.5 |\n| other one | 12 |\n");
}

TEST(Table, figures_have_three_digits) {
  EXPECT_EQ(figure(0.012345), "0.0123");
  EXPECT_EQ(figure(1.2345), "1.23");
  EXPECT_EQ(figure(1234.5), "1234");
  EXPECT_EQ(figure(0.0), "0");
  EXPECT_EQ(error_figure(0.000129), "1.3e-04");
  EXPECT_EQ(figure(std::nan("")), "-");
}

TEST(SvgPlot, has_every_line_once_and_only_points_it_can_draw) {
  const std::string svg =
      svg_of({{"Time", "size", "s", {{"ours", {{1e4, 0.01}, {1e5, 0.1}, {1e6, 0.0}}}, {"R&D", {{1e5, 1.0}}}}},
              {"Memory", "size", "MB", {{"ours", {{1e4, std::nan("")}}}}}});
  const auto count = [&](const std::string& text) {
    int found = 0;
    for (std::size_t at = svg.find(text); at != std::string::npos; at = svg.find(text, at + 1)) ++found;
    return found;
  };
  EXPECT_EQ(count("<circle"), 3);
  EXPECT_EQ(count(">ours<"), 1);
  EXPECT_EQ(count(">R&amp;D<"), 1);
  EXPECT_EQ(count("nan"), 0);
  EXPECT_EQ(count("inf"), 0);
  EXPECT_EQ(svg.substr(svg.size() - 7), "</svg>\n");
}

TEST(MarkdownSection, is_replaced_and_what_is_round_it_stays) {
  const fs::path page = temporary("page.md");
  write_text(page, "# Title\n");
  write_markdown_section(page, "speed", "old\n");
  std::ofstream(page, std::ios::app) << "\nAfter.\n";
  write_markdown_section(page, "memory", "much\n");
  write_markdown_section(page, "speed", "new\n");
  EXPECT_EQ(text_of(page),
            "# Title\n\n<!-- speed -->\n\nnew\n\n<!-- /speed -->\n\nAfter.\n\n<!-- memory -->\n\nmuch\n\n"
            "<!-- /memory -->\n");
  fs::remove(page);
}

}  // namespace
}  // namespace sinew
