#include "io/obj_writer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <fstream>
#include <sstream>

#include "io/atomic_file.h"
#include "io/mesh_reader.h"
#include "tests/io/refusal.h"

namespace sinew {
namespace {

std::filesystem::path temporary(const std::string& name) {
  // Tests run side by side, each in a process of its own.
  return std::filesystem::path(testing::TempDir()) / ("sinew_obj_writer_" + std::to_string(::getpid()) + "_" + name);
}

std::string written(const MeshAsset& asset, const Field3& positions) {
  const std::filesystem::path path = temporary("frame.obj");
  write_obj(path, asset, positions);
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  std::filesystem::remove(path);
  return text.str();
}

//  4---3     Two triangles with a seam at 1, hard where they meet; the last v is used by none.
//  | / |
//  1---2
const std::string kSheet =
    "g sheet\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 5 5 5\n"
    "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.1 0.7\nvn 0 0 1\nvn 0 1 0\n"
    "f 1/1/1 2/2/1 3/3/1\nf 1/5/2 3/3/2 4/4/2\n";

std::vector<std::string> lines_that_begin_with(const std::string& text, const std::string& keyword) {
  std::vector<std::string> found;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) {
    if (line.starts_with(keyword + " ")) found.push_back(line);
  }
  return found;
}

TEST(WriteObj, the_rest_frame_reads_back_as_the_source) {
  const MeshAsset source = parse_mesh(kSheet, "sheet.obj");
  const MeshAsset again = parse_mesh(written(source, source.mesh.positions), "sheet.obj");
  EXPECT_EQ(again.source_positions, source.source_positions);
  EXPECT_EQ(again.file_vertex_of_row, source.file_vertex_of_row);
  EXPECT_EQ(again.mesh.triangles, source.mesh.triangles);
  ASSERT_EQ(again.primitives.size(), 1U);
  EXPECT_EQ(again.primitives[0].name, "sheet");
  EXPECT_EQ(again.primitives[0].indices, source.primitives[0].indices);
  ASSERT_EQ(again.primitives[0].attributes.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(again.primitives[0].attributes[i].name, source.primitives[0].attributes[i].name);
    EXPECT_EQ(again.primitives[0].attributes[i].data, source.primitives[0].attributes[i].data);
  }
}

TEST(WriteObj, writes_the_files_own_vertices_in_its_order_and_seams_as_texture_coordinates) {
  const MeshAsset source = parse_mesh(kSheet, "sheet.obj");
  const std::string text = written(source, source.mesh.positions);
  EXPECT_EQ(lines_that_begin_with(text, "v"),
            (std::vector<std::string>{"v 0 0 0", "v 1 0 0", "v 1 1 0", "v 0 1 0", "v 5 5 5"}));
  EXPECT_EQ(lines_that_begin_with(text, "vt").back(), "vt 1 1") << "the copy of 3, which came last";
  EXPECT_EQ(lines_that_begin_with(text, "f").size(), 2U);
}

TEST(WriteObj, positions_come_back_to_the_last_bit) {
  const MeshAsset source = parse_mesh("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "t.obj");
  Field3 positions(3, 3);
  positions << 1.0 / 3.0, -1e-300, 0.1, 1e22, -0.0, 5e-324, M_PI, 1e17, -123456.789;
  const MeshAsset again = parse_mesh(written(source, positions), "t.obj");
  EXPECT_EQ(std::memcmp(again.source_positions.data(), positions.data(), sizeof(double) * 9), 0);
}

TEST(WriteObj, normals_turn_with_the_surface_and_hard_edges_stay_hard) {
  const MeshAsset source = parse_mesh(kSheet, "sheet.obj");
  // A quarter turn about x: y becomes z, z becomes -y.
  Field3 turned = source.mesh.positions;
  turned.col(1) = -source.mesh.positions.col(2);
  turned.col(2) = source.mesh.positions.col(1);
  const MeshAsset again = parse_mesh(written(source, turned), "sheet.obj");
  const auto& before = source.primitives[0].attributes[0];
  const auto& after = again.primitives[0].attributes[0];
  ASSERT_EQ(before.name, "NORMAL");
  ASSERT_EQ(after.data.size(), before.data.size());
  std::vector<float> a(before.data.size() / 4), b(a.size());
  std::memcpy(a.data(), before.data.data(), before.data.size());
  std::memcpy(b.data(), after.data.data(), after.data.size());
  for (const int row : source.primitives[0].indices) {
    EXPECT_NEAR(b[3 * row], a[3 * row], 1e-6);
    EXPECT_NEAR(b[3 * row + 1], -a[3 * row + 2], 1e-6);
    EXPECT_NEAR(b[3 * row + 2], a[3 * row + 1], 1e-6);
  }
}

TEST(WriteObj, a_source_without_normals_or_texture_coordinates_gets_none) {
  const MeshAsset source = parse_mesh("OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "t.off");
  EXPECT_EQ(written(source, source.mesh.positions), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
}

TEST(WriteObj, each_primitive_is_a_group) {
  const MeshAsset source = parse_mesh("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng a\nf 1 3 2\ng b\nf 1 2 4\n", "t.obj");
  const std::string text = written(source, source.mesh.positions);
  EXPECT_EQ(text, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng a\nf 1 3 2\ng b\nf 1 2 4\n");
}

TEST(WriteObj, refuses_too_few_positions_and_a_folder_that_is_not_there) {
  const MeshAsset source = parse_mesh(kSheet, "sheet.obj");
  EXPECT_THROW(write_obj(temporary("few.obj"), source, source.mesh.positions.topRows(2)), std::invalid_argument);
  EXPECT_FALSE(std::filesystem::exists(temporary("few.obj")));
  EXPECT_EQ(refusal([&] { write_obj("/nowhere/frame.obj", source, source.mesh.positions); }),
            "/nowhere/frame.obj: cannot write here: No such file or directory");
}

}  // namespace
}  // namespace sinew
