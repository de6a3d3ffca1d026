#include "io/mesh_reader.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cstring>
#include <limits>
#include <sstream>

#include "tests/io/refusal.h"

namespace sinew {
namespace {

MeshAsset parse(const std::string& text, const std::string& name) { return parse_mesh(text, name); }
std::string refused(const std::string& text, const std::string& name) {
  return refusal([&] { parse(text, name); });
}

std::filesystem::path shared_data() { return SINEW_SHARED_DATA; }

// The same tetrahedron in every format: 3 above the triangle 0 1 2.
const std::string kObj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
const std::string kOff = "OFF\n4 4 6\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
const std::string kPlyHeader =
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    "element face 4\nproperty list uchar int vertex_indices\nend_header\n";
const std::string kPly = "ply\nformat ascii 1.0\n" + kPlyHeader +
                         "0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
const float kPoints[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
const std::int32_t kFaces[4][3] = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

template <class T>
std::string bytes_of(T value, bool big) {
  std::string raw(sizeof(T), '\0');
  std::memcpy(raw.data(), &value, sizeof(T));
  return big ? std::string(raw.rbegin(), raw.rend()) : raw;
}

std::string binary_ply(bool big) {
  std::string text = std::string("ply\nformat binary_") + (big ? "big" : "little") + "_endian 1.0\n" + kPlyHeader;
  for (const auto& point : kPoints) {
    for (const float value : point) text += bytes_of(value, big);
  }
  for (const auto& face : kFaces) {
    text += '\3';
    for (const std::int32_t vertex : face) text += bytes_of(vertex, big);
  }
  return text;
}

std::string binary_stl() {
  std::string text(80, ' ');
  text += bytes_of(std::uint32_t{4}, false);
  for (const auto& face : kFaces) {
    text += std::string(12, '\0');
    for (const std::int32_t vertex : face) {
      for (const float value : kPoints[vertex]) text += bytes_of(value, false);
    }
    text += std::string(2, '\0');
  }
  return text;
}

std::string text_stl() {
  std::string text = "solid tetrahedron\n";
  for (const auto& face : kFaces) {
    text += "facet normal 0 0 0\n outer loop\n";
    for (const std::int32_t vertex : face) {
      std::ostringstream line;
      line << "  vertex " << kPoints[vertex][0] << ' ' << kPoints[vertex][1] << ' ' << kPoints[vertex][2] << '\n';
      text += line.str();
    }
    text += " endloop\nendfacet\n";
  }
  return text + "endsolid tetrahedron\n";
}

struct Sample {
  std::string name;
  std::string bytes;
};

std::vector<Sample> samples_of_all_formats() {
  return {{"t.obj", kObj},      {"t.off", kOff},       {"t.ply", kPly},           {"t.ply", binary_ply(false)},
          {"t.ply", binary_ply(true)}, {"t.stl", binary_stl()}, {"t.stl", text_stl()}};
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, text.npos) << from;
  return text.replace(at, from.size(), to);
}

std::string without_carriage(std::string text, const std::string& ending) {
  for (std::size_t at = 0; (at = text.find('\n', at)) != text.npos; at += ending.size()) text.replace(at, 1, ending);
  return text;
}

std::vector<float> floats_of(const VertexAttribute& attribute) {
  std::vector<float> values(attribute.data.size() / sizeof(float));
  std::memcpy(values.data(), attribute.data.data(), attribute.data.size());
  return values;
}

const VertexAttribute& attribute_of(const SourcePrimitive& primitive, const std::string& name) {
  for (const VertexAttribute& attribute : primitive.attributes) {
    if (attribute.name == name) return attribute;
  }
  throw std::runtime_error("no attribute " + name);
}

// All formats

TEST(ParseMesh, the_same_tetrahedron_comes_out_of_every_format) {
  const MeshAsset expected = parse(kObj, "t.obj");
  ASSERT_EQ(expected.mesh.triangles.size(), 4U);
  for (const Sample& sample : samples_of_all_formats()) {
    const MeshAsset asset = parse(sample.bytes, sample.name);
    EXPECT_TRUE(asset.diagnosis.closed) << sample.bytes.substr(0, 60);
    EXPECT_TRUE(asset.diagnosis.outward);
    EXPECT_EQ(asset.diagnosis.source_faces, 4);
    EXPECT_TRUE(asset.warnings.empty());
    EXPECT_EQ("t." + asset.format, sample.name);
    ASSERT_EQ(asset.mesh.triangles.size(), 4U);
    for (std::size_t t = 0; t < 4; ++t) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        EXPECT_EQ(asset.mesh.positions.row(asset.mesh.triangles[t][corner]),
                  expected.mesh.positions.row(expected.mesh.triangles[t][corner]));
      }
    }
  }
}

TEST(ParseMesh, every_truncated_prefix_gives_a_mesh_or_a_file_error) {
  for (const Sample& sample : samples_of_all_formats()) {
    for (std::size_t size = 0; size < sample.bytes.size(); ++size) {
      try {
        parse(sample.bytes.substr(0, size), sample.name);
      } catch (const FileError&) {
      }
    }
  }
}

TEST(ParseMesh, every_byte_changed_gives_a_mesh_or_a_file_error) {
  for (const Sample& sample : samples_of_all_formats()) {
    for (std::size_t at = 0; at < sample.bytes.size(); ++at) {
      for (const int change : {0x00, 0xFF, int{' '}, int{'-'}, int{'9'}, int{'\n'}, sample.bytes[at] + 1, sample.bytes[at] - 1}) {
        std::string bytes = sample.bytes;
        bytes[at] = static_cast<char>(change);
        try {
          parse(bytes, sample.name);
        } catch (const FileError&) {
        }
      }
    }
  }
}

TEST(ParseMesh, line_ends_and_a_byte_order_mark_make_no_difference) {
  for (const Sample& sample : {Sample{"t.obj", kObj}, Sample{"t.off", kOff}, Sample{"t.ply", kPly}, Sample{"t.stl", text_stl()}}) {
    const MeshAsset expected = parse(sample.bytes, sample.name);
    for (const char* ending : {"\r\n", "\r"}) {
      const MeshAsset asset = parse(without_carriage(sample.bytes, ending), sample.name);
      EXPECT_EQ(asset.mesh.triangles, expected.mesh.triangles);
      EXPECT_EQ(asset.mesh.positions, expected.mesh.positions);
    }
    EXPECT_EQ(parse("\xEF\xBB\xBF" + sample.bytes, sample.name).mesh.triangles, expected.mesh.triangles);
    EXPECT_EQ(parse(sample.bytes.substr(0, sample.bytes.size() - 1), sample.name).mesh.triangles, expected.mesh.triangles);
  }
}

TEST(ParseMesh, says_what_a_file_is_that_only_has_the_name_of_a_mesh) {
  const std::string pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:0123\nsize 12\n";
  EXPECT_EQ(refused(pointer, "a.obj"),
            "a.obj: is a Git LFS pointer, not an OBJ file; fetch what it points to with 'git lfs pull'");
  EXPECT_EQ(refused("\n  <!DOCTYPE html><html>", "a.ply"), "a.ply: is a web page, not a PLY file; download the file itself");
  EXPECT_EQ(refused("<HTML>", "a.off"), "a.off: is a web page, not an OFF file; download the file itself");
  EXPECT_EQ(refused("\xFF\xFEv\0 ", "a.stl"), "a.stl: is UTF-16 text, not an STL file; save it as UTF-8");
  EXPECT_EQ(refused("\x1F\x8B\x08", "a.ply"), "a.ply: is a compressed file, not a PLY file; unpack it first");
  EXPECT_EQ(refused(kObj, "a.fbx"),
            "a.fbx: is not a mesh by its extension; expected .obj, .ply, .off, .stl, .gltf or .glb");
  EXPECT_EQ(refused(std::string("\x01\x02garbage"), "a.obj"), "a.obj: is not an OBJ file: no line begins with 'v' or 'f'");
}

TEST(ParseMesh, an_empty_file_is_refused) {
  EXPECT_EQ(refused("", "a.obj"), "a.obj: no triangles; a mesh needs a surface");
  EXPECT_EQ(refused("", "a.ply"), "a.ply:1: begins without the line 'ply'");
  EXPECT_EQ(refused("", "a.off"), "a.off:1: file is empty; expected OFF");
  EXPECT_EQ(refused("", "a.stl"), "a.stl@0: file ends inside the header; expected 'solid', or 84 bytes of binary STL");
}

TEST(ParseMesh, numbers_are_finite_and_read_the_same_in_every_locale) {
  const auto with = [](const std::string& number) { return replaced(kObj, "v 1 0 0", "v " + number + " 0 0"); };
  for (const char* one : {"1.", "+1", "1e0", "1.0E+00", "10e-1", "0.1e1"}) {
    EXPECT_EQ(parse(with(one), "t.obj").mesh.positions, parse(kObj, "t.obj").mesh.positions) << one;
  }
  EXPECT_EQ(parse(with(".5"), "t.obj").mesh.positions(1, 0), 0.5);
  EXPECT_EQ(parse(replaced(kObj, "v 0 0 0", "v 1e-400 -1e-400 0"), "t.obj").source_positions(0, 0), 0.0);
  EXPECT_EQ(refused(with("nan"), "t.obj"), "t.obj:2: 'nan' is not a finite number");
  EXPECT_EQ(refused(with("-inf"), "t.obj"), "t.obj:2: '-inf' is not a finite number");
  EXPECT_EQ(refused(with("1.#QNAN"), "t.obj"), "t.obj:2: '1.#QNAN' is not a number");
  EXPECT_EQ(refused(with("1,5"), "t.obj"), "t.obj:2: '1,5' is not a number");
  EXPECT_EQ(refused(with("0x1p3"), "t.obj"), "t.obj:2: '0x1p3' is not a number");
  EXPECT_EQ(refused(with("1e400"), "t.obj"), "t.obj:2: '1e400' is out of range for a number");
  EXPECT_EQ(refused(with("+-1"), "t.obj"), "t.obj:2: '+-1' is not a number");
}

TEST(ParseMesh, the_cuts_of_a_polygon_do_not_overlap_and_leave_nothing_out) {
  //  An arrow head, a comb, and a square with a corner in the middle of a side; areas by hand.
  struct Polygon {
    std::vector<Eigen::Vector2d> corners;
    double area;
  };
  const Polygon polygons[] = {
      {{{0, 0}, {4, 0}, {1, 1}, {0, 4}}, 4.0},
      {{{0, 0}, {5, 0}, {5, 3}, {4, 3}, {4, 1}, {3, 1}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}}, 11.0},
      {{{0, 0}, {1, 0}, {2, 0}, {2, 2}, {0, 2}}, 4.0}};
  for (const Polygon& polygon : polygons) {
    for (std::size_t first = 0; first < polygon.corners.size(); ++first) {  // whichever corner leads
      std::ostringstream text;
      std::string face = "f";
      for (std::size_t i = 0; i < polygon.corners.size(); ++i) {
        const Eigen::Vector2d& corner = polygon.corners[(first + i) % polygon.corners.size()];
        text << "v " << corner.x() + 100 << " 7 " << -corner.y() << "\n";  // seen from +y, counter-clockwise
        face += " " + std::to_string(i + 1);
      }
      const MeshAsset asset = parse(text.str() + face + "\n", "polygon.obj");
      ASSERT_EQ(asset.mesh.triangles.size(), polygon.corners.size() - 2);
      double area = 0;
      for (const auto& t : asset.mesh.triangles) {
        const Eigen::Vector3d a = asset.mesh.positions.row(t[0]), b = asset.mesh.positions.row(t[1]),
                              c = asset.mesh.positions.row(t[2]);
        const double up = (b - a).cross(c - a).y() / 2;
        EXPECT_GT(up, 0.0) << "each triangle turns as the polygon does";
        area += up;
      }
      EXPECT_NEAR(area, polygon.area, 1e-12);
      EXPECT_EQ(asset.diagnosis.source_faces, 1);
    }
  }
}

TEST(ParseMesh, faces_that_cannot_be_cut_well_are_counted_not_dropped_in_silence) {
  const std::string bow_tie = "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2.5 0\nf 1 2 3 4\n";
  const MeshAsset crossed = parse(bow_tie, "t.obj");
  EXPECT_EQ(crossed.diagnosis.triangles, 2);
  const MeshAsset thin = parse(kObj + "f 1 2\nf 3\n", "t.obj");
  EXPECT_EQ(thin.diagnosis.source_faces, 6);
  EXPECT_EQ(thin.warnings, std::vector<std::string>{"W_MESH_FACE_TOO_SMALL: 2 faces of fewer than 3 corners left out"});
}

TEST(ParseMesh, a_face_of_many_corners_takes_a_moment_not_an_hour) {
  // A zigzag: every other corner is reflex.
  constexpr int kTeeth = 30'000;
  std::ostringstream text;
  std::string face = "f";
  for (int i = 0; i < 2 * kTeeth; ++i) text << "v " << i << ' ' << 10 * (i % 2) << " 0\n";
  text << "v " << 2 * kTeeth << " 1000 0\nv 0 1000 0\n";
  for (int i = 1; i <= 2 * kTeeth + 2; ++i) face += " " + std::to_string(i);
  EXPECT_EQ(parse(text.str() + face, "t.obj").diagnosis.triangles, 2 * kTeeth);
}

// OBJ

TEST(ParseObj, every_form_of_corner_means_the_same) {
  const MeshAsset expected = parse(kObj, "t.obj");
  const std::string tail = "vt 0 0\nvn 0 0 1\n";
  for (const char* faces : {"f 1/1 3/1 2/1\nf 1/1/1 2/1/1 4/1/1\nf 2//1 3//1 4//1\nf 3 1 4\n",
                            "f -4 -2 -3\nf -4/-1 -3/-1 -1/-1\nf -3//-1 -2//-1 -1//-1\nf 3/ 1/ 4/\n",
                            "f 1 3 \\\n2\nf \\\r\n 1 2 4 # comment\nf\t2  3\t4 \nf 3 1 4\n"}) {
    const MeshAsset asset = parse(kObj.substr(0, kObj.find('f')) + tail + faces, "t.obj");
    EXPECT_EQ(asset.mesh.triangles, expected.mesh.triangles) << faces;
    EXPECT_EQ(asset.mesh.positions, expected.mesh.positions);
  }
}

TEST(ParseObj, names_the_line_of_an_index_that_leads_nowhere) {
  EXPECT_EQ(refused(kObj + "f 0 1 2\n", "t.obj"), "t.obj:9: vertex index 0; OBJ counts from 1");
  EXPECT_EQ(refused(kObj + "f 1 2 9\nf 1 2 3\n", "t.obj"), "t.obj:9: vertex index 9; the file has 4");
  EXPECT_EQ(refused(kObj + "f 1 2 -5\n", "t.obj"), "t.obj:9: vertex index -5; the file has 4 so far");
  EXPECT_EQ(refused(kObj + "f 1/1 2 3\n", "t.obj"), "t.obj:9: texture index 1; the file has 0");
  EXPECT_EQ(refused(kObj + "vn 0 0 1\nf 1//2 2 3\n", "t.obj"), "t.obj:10: normal index 2; the file has 1");
  EXPECT_EQ(refused(kObj + "f 1 2 99999999999999999999\n", "t.obj"),
            "t.obj:9: '99999999999999999999' is out of range for a whole number");
  EXPECT_EQ(refused(kObj + "f 1/2/3/4 2 3\n", "t.obj"), "t.obj:9: corner '1/2/3/4'; expected v, v/vt, v//vn or v/vt/vn");
  EXPECT_EQ(refused(kObj + "f 1.5 2 3\n", "t.obj"), "t.obj:9: '1.5' is not a whole number");
  EXPECT_EQ(refused(kObj + "f\n", "t.obj"), "t.obj:9: f has no corners; expected 3 or more");
  EXPECT_EQ(refused(kObj + "v 1 2\n", "t.obj"), "t.obj:9: v has 2 values; expected 3, 4, 6 or 7");
  EXPECT_EQ(refused(kObj + "vn 1 2\n", "t.obj"), "t.obj:9: vn has 2 values; expected 3");
}

TEST(ParseObj, a_face_may_point_ahead) {
  const std::string ahead = kObj.substr(kObj.find('f')) + kObj.substr(0, kObj.find('f'));
  EXPECT_EQ(parse(ahead, "t.obj").mesh.triangles, parse(kObj, "t.obj").mesh.triangles);
}

TEST(ParseObj, vertices_keep_the_files_order_and_copies_follow_in_order_of_use) {
  //  4---3     vertex 1 has texture coordinate 1 in the first face and 5 in the second; 5 is used by none.
  //  | / |
  //  1---2
  const MeshAsset asset = parse(
      "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
      "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.5 0.25\n"
      "f 2/1 3/2 4/3\nf 2/5 4/3 5/4\n", "t.obj");
  EXPECT_EQ(asset.file_vertex_of_row, (std::vector<int>{0, 1, 2, 3, 4, 1}));
  EXPECT_EQ(asset.source_positions.row(0), Eigen::RowVector3d(9, 9, 9));
  EXPECT_EQ(asset.vertex_of_source, (std::vector<int>{-1, 0, 1, 2, 3, 0}));
  EXPECT_EQ(asset.primitives[0].indices, (std::vector<std::uint32_t>{1, 2, 3, 5, 3, 4}));
  // glTF counts texture rows from the top.
  EXPECT_EQ(floats_of(attribute_of(asset.primitives[0], "TEXCOORD_0")),
            (std::vector<float>{0, 1, 0, 1, 1, 1, 1, 0, 0, 0, 0.5F, 0.75F}));
  EXPECT_EQ(asset.diagnosis.boundary_edges, 4);
}

TEST(ParseObj, groups_and_materials_become_primitives_with_vertices_of_their_own) {
  const MeshAsset asset = parse(
      "o body\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\ng legs\nf 1 3 2\ng arms\nf 1 2 4\nusemtl red\nf 2 3 4\ng legs\n"
      "usemtl\nf 3 1 4\n", "t.obj");
  ASSERT_EQ(asset.primitives.size(), 3U);
  EXPECT_EQ(asset.primitives[0].name, "legs");
  EXPECT_EQ(asset.primitives[0].indices.size(), 6U) << "a group taken up again goes on";
  EXPECT_EQ(asset.primitives[1].name, "arms");
  EXPECT_EQ(asset.primitives[2].name, "arms");
  int next = 0;
  for (const SourcePrimitive& primitive : asset.primitives) {
    EXPECT_EQ(primitive.first_vertex, next);
    next += primitive.vertex_count;
    EXPECT_EQ(primitive.material, -1);
  }
  EXPECT_EQ(next, asset.source_positions.rows());
  EXPECT_TRUE(asset.diagnosis.closed);
}

TEST(ParseObj, too_many_groups_are_read_as_one) {
  std::string text = kObj.substr(0, kObj.find('f'));
  for (int i = 0; i < 5000; ++i) text += "g " + std::to_string(i) + "\nf 1 2 3\n";
  const MeshAsset asset = parse(text, "t.obj");
  EXPECT_EQ(asset.primitives.size(), 1U);
  EXPECT_EQ(asset.diagnosis.triangles, 5000);
  EXPECT_EQ(asset.warnings, std::vector<std::string>{"W_OBJ_GROUPS: more than 4096 groups read as one"});
}

TEST(ParseObj, one_vertex_with_many_texture_coordinates_takes_a_moment_not_an_hour) {
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  constexpr int kPairs = 200'000;
  for (int i = 0; i < kPairs; ++i) text += "vt 0 0\n";
  for (int i = 1; i <= kPairs; ++i) text += "f 1/" + std::to_string(i) + " 2/1 3/1\n";
  EXPECT_EQ(parse(text, "t.obj").source_positions.rows(), 3 + kPairs - 1);
}

TEST(ParseObj, vertex_colours_become_linear) {
  const std::string faces = kObj.substr(kObj.find('f'));
  const MeshAsset unit = parse("v 0 0 0 1 0.5 0\nv 1 0 0 0 0 0\nv 0 1 0 1 1 1\nv 0 0 1\n" + faces, "t.obj");
  const MeshAsset bytes = parse("v 0 0 0 255 127.5 0\nv 1 0 0 0 0 0\nv 0 1 0 255 255 255\nv 0 0 1 255 255 255\n" + faces, "t.obj");
  const std::vector<float> colours = floats_of(attribute_of(unit.primitives[0], "COLOR_0"));
  EXPECT_NEAR(colours[0], 1.0, 1e-6);
  EXPECT_NEAR(colours[1], 0.2140, 1e-4) << "half, in the sRGB encoding";
  EXPECT_EQ(colours[9], 1.0F) << "white where the file gives none";
  EXPECT_EQ(floats_of(attribute_of(bytes.primitives[0], "COLOR_0")), colours);
}

TEST(ParseObj, normals_are_carried_only_when_every_corner_has_one) {
  const std::string normal = "vn 0 0 2\n";
  const MeshAsset whole = parse("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + normal + "f 1//1 2//1 3//1\n", "t.obj");
  EXPECT_EQ(floats_of(attribute_of(whole.primitives[0], "NORMAL")), (std::vector<float>{0, 0, 1, 0, 0, 1, 0, 0, 1}));
  const MeshAsset part = parse("g a\nv 0 0 0\nv 1 0 0\nv 0 1 0\n" + normal + "f 1//1 2//1 3\n", "t.obj");
  EXPECT_TRUE(part.primitives[0].attributes.empty());
  EXPECT_EQ(part.warnings, std::vector<std::string>{"W_OBJ_NORMALS: normals of 'a' left out because some corners have none"});
}

TEST(ParseObj, what_is_not_read_is_said_once) {
  const MeshAsset asset = parse("mtllib a.mtl\n" + kObj + "call other.obj\nl 1 2\ncall other.obj\ns 1\n", "t.obj");
  EXPECT_EQ(asset.warnings,
            (std::vector<std::string>{"W_OBJ_MATERIALS: materials are not carried from OBJ files",
                                      "W_OBJ_UNKNOWN: 3 lines of kinds that are not read, the first 'call' at line 10"}));
}

TEST(ParseObj, a_comment_begins_like_a_word) {
  const MeshAsset asset = parse("g a#1 # the first\n# all of it\n" + kObj, "t.obj");
  EXPECT_EQ(asset.primitives[0].name, "a#1");
}

TEST(ParseObj, names_are_cut_and_made_printable) {
  const MeshAsset asset = parse("g caf\xE9 \xC3\xA9\x01\n" + kObj, "t.obj");
  EXPECT_EQ(asset.primitives[0].name, "caf? \xC3\xA9?");
}

// PLY

TEST(ParsePly, reads_normals_texture_coordinates_and_colours_in_any_order) {
  const MeshAsset asset = parse(
      "ply\nformat ascii 1.0\ncomment made by hand\nelement camera 1\nproperty float fov\nelement vertex 3\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\nproperty double z\n"
      "property double y\nproperty double x\nproperty float confidence\nproperty float s\nproperty float t\n"
      "property float nx\nproperty float ny\nproperty float nz\n"
      "element face 1\nproperty uchar flags\nproperty list uchar uint vertex_index\nend_header\n"
      "45\n255 0 0 255 0 0 0 0.5 0 0 0 0 2\n0 255 0 255 0 0 1 0.5 1 0 0 0 1\n0 0 255 9 0 1 0 0.5 0 1 0 0 0\n"
      "7 3 0 1 2\n", "t.ply");
  EXPECT_EQ(asset.source_positions.row(1), Eigen::RowVector3d(1, 0, 0));
  const SourcePrimitive& primitive = asset.primitives[0];
  EXPECT_EQ(floats_of(attribute_of(primitive, "COLOR_0")), (std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1}));
  EXPECT_EQ(floats_of(attribute_of(primitive, "TEXCOORD_0")), (std::vector<float>{0, 1, 1, 1, 0, 0}));
  EXPECT_EQ(floats_of(attribute_of(primitive, "NORMAL")), (std::vector<float>{0, 0, 1, 0, 0, 1, 0, 0, 1}));
  EXPECT_EQ(asset.warnings,
            (std::vector<std::string>{"W_MESH_NORMAL: 1 normal of no length replaced by +z",
                                      "W_PLY_LEFT_OUT: not carried: 'camera', 'vertex.confidence', 'face.flags'"}));
}

TEST(ParsePly, refuses_with_the_line_in_text_and_the_byte_in_binary) {
  EXPECT_EQ(refused(replaced(kPly, "3 0 1 3", "3 0 1 4"), "t.ply"),
            "t.ply:15: vertex index 4; the file has 4 vertices, counted from 0");
  EXPECT_EQ(refused(replaced(kPly, "3 0 1 3", "3 0 1"), "t.ply"), "t.ply:15: line ends too soon; expected another value");
  EXPECT_EQ(refused(replaced(kPly, "3 0 1 3", "3 0 1 3 3"), "t.ply"),
            "t.ply:15: line has more values than its element has properties");
  EXPECT_EQ(refused(replaced(kPly, "1 0 0", "1 0 nan"), "t.ply"), "t.ply:11: 'nan' is not a finite number");
  EXPECT_EQ(refused(replaced(kPly, "3 2 0 3\n", ""), "t.ply"), "t.ply:16: file ends after 3 of 4 items of 'face'");
  EXPECT_EQ(refused(replaced(kPly, "3 2 0 3", "-3 2 0 3"), "t.ply"), "t.ply:17: list has the length -3");
  EXPECT_EQ(refused(replaced(kPly, "3 2 0 3", "999999999 2 0 3"), "t.ply"),
            "t.ply:17: announces 999999999 values of 'vertex_indices'; the 6 bytes that follow hold at most 6");
  const std::string header = "ply\nformat binary_little_endian 1.0\n" + kPlyHeader;
  const auto at = [&](std::size_t byte) { return "t.ply@" + std::to_string(header.size() + byte) + ": "; };
  const std::string binary = binary_ply(false);
  EXPECT_EQ(refused(binary.substr(0, binary.size() - 1), "t.ply"),
            at(48 + 3 * 13 + 1) + "announces 3 values of 'vertex_indices'; the 11 bytes that follow hold at most 2");
  std::string infinite = binary;
  infinite.replace(header.size() + 16, 4, bytes_of(std::numeric_limits<float>::infinity(), false));
  EXPECT_EQ(refused(infinite, "t.ply"), at(16) + "value is not a finite number");
}

TEST(ParsePly, refuses_counts_that_the_file_cannot_hold_before_reading_on) {
  EXPECT_EQ(refused(replaced(kPly, "vertex 4", "vertex 4000000000"), "t.ply"),
            "t.ply:9: announces 4000000000 items of 'vertex'; the 56 bytes that follow hold at most 11");
  EXPECT_EQ(refused(replaced(kPly, "face 4", "face 1000000000000000000"), "t.ply"),
            "t.ply:13: announces 1000000000000000000 items of 'face'; the 32 bytes that follow hold at most 32");
  EXPECT_EQ(refused(replaced(kPly, "face 4", "face 99999999999999999999"), "t.ply"),
            "t.ply:7: '99999999999999999999' is out of range for a whole number");
  EXPECT_EQ(refused(replaced(kPly, "element vertex 4", "element void 4000000000\nelement vertex 4"), "t.ply"),
            "t.ply:10: announces 4000000000 items of 'void'; the 56 bytes that follow hold at most 56");
}

TEST(ParsePly, refuses_headers_it_does_not_understand) {
  EXPECT_EQ(refused(replaced(kPly, "ascii", "utf8"), "t.ply"),
            "t.ply:2: format 'utf8'; expected ascii, binary_little_endian or binary_big_endian");
  EXPECT_EQ(refused(replaced(kPly, "float x", "real x"), "t.ply"),
            "t.ply:4: type 'real'; expected char, uchar, short, ushort, int, uint, float or double");
  EXPECT_EQ(refused(replaced(kPly, "uchar int", "float int"), "t.ply"),
            "t.ply:8: length of a list in floating point; expected an integer type");
  EXPECT_EQ(refused(replaced(kPly, "property float x\n", ""), "t.ply"), "t.ply:8: element 'vertex' lacks one of x, y and z");
  EXPECT_EQ(refused(replaced(kPly, "vertex_indices", "indices"), "t.ply"),
            "t.ply:13: element 'face' has no integer list 'vertex_indices'");
  EXPECT_EQ(refused(replaced(kPly, "end_header\n", ""), "t.ply"),
            "t.ply:9: found '0'; expected 'element', 'property' or 'end_header'");
  EXPECT_EQ(refused("ply\nformat ascii 1.0\nelement vertex 1\n", "t.ply"),
            "t.ply:3: file ends inside the header; expected 'end_header'");
  EXPECT_EQ(refused(replaced(kPly, "element face", "element tristrips"), "t.ply"),
            "t.ply:13: triangle strips are not read; save the mesh as faces");
}

// OFF

TEST(ParseOff, reads_what_each_prefix_adds) {
  const std::string faces = "3 0 1 2\n";
  struct Kind {
    std::string keyword, extra;
    std::vector<std::string> attributes;
  };
  const Kind kinds[] = {{"OFF", "", {}},
                        {"COFF", " 1 0 0 1", {"COLOR_0"}},
                        {"COFF", " 255 0 0", {"COLOR_0"}},
                        {"NOFF", " 0 0 1", {"NORMAL"}},
                        {"STOFF", " 0.5 0.5", {"TEXCOORD_0"}},
                        {"STCNOFF", " 0 0 1 1 0 0 1 0.5 0.5", {"NORMAL", "TEXCOORD_0", "COLOR_0"}}};
  for (const Kind& kind : kinds) {
    const MeshAsset asset = parse(kind.keyword + " # comment\n# comment\n3 1 # no edges\n0 0 0" + kind.extra + "\n\n1 0 0" +
                                      kind.extra + "\n0 1 0" + kind.extra + "\n" + faces, "t.off");
    std::vector<std::string> names;
    for (const VertexAttribute& attribute : asset.primitives[0].attributes) names.push_back(attribute.name);
    EXPECT_EQ(names, kind.attributes) << kind.keyword;
    EXPECT_EQ(asset.mesh.triangles.size(), 1U);
    if (!names.empty() && names.back() == "COLOR_0") {
      EXPECT_EQ(floats_of(attribute_of(asset.primitives[0], "COLOR_0"))[0], 1.0F);
    }
  }
}

TEST(ParseOff, takes_polygons_with_colours_and_counts_on_the_first_line) {
  const MeshAsset asset = parse("OFF 4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3 255 0 0\n", "t.off");
  EXPECT_EQ(asset.mesh.triangles.size(), 2U);
}

TEST(ParseOff, says_that_colours_nobody_announced_are_not_read) {
  const MeshAsset asset = parse("OFF\n3 1 0\n0 0 0 255 0 0\n1 0 0 255 0 0 255\n0 1 0\n3 0 1 2\n", "t.off");
  EXPECT_EQ(asset.warnings, std::vector<std::string>{"W_OFF_COLOURS: 2 colours not read because the file does not begin with COFF"});
}

TEST(ParseOff, refuses_with_the_line) {
  EXPECT_EQ(refused(replaced(kOff, "OFF", "FOO"), "t.off"), "t.off:1: begins with 'FOO'; expected OFF");
  EXPECT_EQ(refused(replaced(kOff, "OFF", "4OFF"), "t.off"), "t.off: '4OFF' is not three-dimensional");
  EXPECT_EQ(refused(replaced(kOff, "OFF", "OFF BINARY"), "t.off"),
            "t.off: is a binary OFF file, which is not read; save it as text");
  EXPECT_EQ(refused(replaced(kOff, "4 4 6", "-4 4 6"), "t.off"),
            "t.off:2: negative count; expected the numbers of vertices and faces");
  EXPECT_EQ(refused(replaced(kOff, "4 4 6", "353535235358 4 6"), "t.off"),
            "t.off:2: announces 353535235358 vertices; the 56 bytes that follow hold at most 11");
  EXPECT_EQ(refused(replaced(kOff, "4 4 6", "5 4 6"), "t.off"), "t.off:7: vertex has 4 values; expected 3");
  EXPECT_EQ(refused(replaced(kOff, "3 0 1 3", "3 0 1"), "t.off"), "t.off:8: face announces 3 corners and has 2");
  EXPECT_EQ(refused(replaced(kOff, "3 0 1 3", "3 0 1 -3"), "t.off"),
            "t.off:8: vertex index -3; the file has 4 vertices, counted from 0");
  EXPECT_EQ(refused(replaced(kOff, "3 2 0 3\n", ""), "t.off"), "t.off:9: file ends after 3 of 4 faces");
  EXPECT_EQ(refused("OFF\n", "t.off"), "t.off:1: file ends before the counts of vertices and faces");
}

// STL

TEST(ParseStl, a_binary_file_may_begin_with_solid) {
  std::string bytes = binary_stl();
  bytes.replace(0, 5, "solid");
  EXPECT_TRUE(parse(bytes, "t.stl").diagnosis.closed);
  EXPECT_TRUE(parse(bytes + "trailing", "t.stl").diagnosis.closed);
}

TEST(ParseStl, each_solid_is_a_primitive) {
  const MeshAsset asset = parse(text_stl() + replaced(text_stl(), "solid tetrahedron", "SOLID two"), "t.stl");
  ASSERT_EQ(asset.primitives.size(), 2U);
  EXPECT_EQ(asset.primitives[1].name, "two");
  EXPECT_EQ(asset.primitives[1].first_vertex, 12);
  EXPECT_EQ(asset.diagnosis.welded_vertices, 4);
  EXPECT_EQ(asset.diagnosis.duplicate_triangles, 4);
}

TEST(ParseStl, refuses_with_the_line_or_the_byte) {
  std::string bytes = binary_stl();
  EXPECT_EQ(refused(bytes.substr(0, 283), "t.stl"),
            "t.stl@80: announces 4 triangles; the 199 bytes that follow hold at most 3");
  EXPECT_EQ(parse(bytes + "x", "t.stl").warnings,
            std::vector<std::string>{"W_STL_TRAILING: 1 byte after the last triangle not read"});
  bytes.replace(84 + 50 + 12, 4, bytes_of(std::numeric_limits<float>::quiet_NaN(), false));
  EXPECT_EQ(refused(bytes, "t.stl"), "t.stl@146: coordinate is not a finite number");
  EXPECT_EQ(refused(replaced(text_stl(), "facet", "face"), "t.stl"), "t.stl:2: found 'face'; expected 'facet' or 'endsolid'");
  EXPECT_EQ(refused(replaced(text_stl(), "endfacet\n", ""), "t.stl"), "t.stl:8: found 'facet'; expected 'vertex' or 'endfacet'");
  EXPECT_EQ(refused(replaced(text_stl(), "vertex 0 0 0", "vertex 0 0"), "t.stl"), "t.stl:4: vertex has 2 values; expected 3");
  EXPECT_EQ(refused(text_stl().substr(0, text_stl().find(" endloop")), "t.stl"), "t.stl:6: file ends inside a facet; expected 'endfacet'");
  EXPECT_EQ(parse(replaced(text_stl(), "endsolid tetrahedron\n", ""), "t.stl").warnings,
            std::vector<std::string>{"W_STL_END: no 'endsolid'; the file may have been cut short"});
}

// Files of others

struct Figures {
  const char* file;
  std::int64_t source_vertices, faces, welded_vertices;
  int components;
  std::int64_t boundary, non_manifold, inconsistent;
};

TEST(ReadMesh, the_shared_meshes_have_the_figures_that_were_measured_elsewhere) {
  if (!std::filesystem::is_directory(shared_data())) GTEST_SKIP() << "no shared data at " << shared_data();
  const Figures table[] = {
      {"meshes/libigl/armadillo.obj", 43243, 86482, 43243, 1, 0, 0, 0},
      {"meshes/makehuman/makehuman_base.obj", 21833, 18486, 19158, 154, 784, 0, 0},
      {"meshes/odedstein/cat-low-resolution.obj", 7949, 15894, 7949, 1, 0, 0, 0},
      {"meshes/odedstein/human_man.obj", 6890, 13776, 6890, 1, 0, 0, 0},
      {"meshes/odedstein/koala.obj", 49999, 99994, 49999, 1, 0, 0, 0},
      {"meshes/odedstein/scorpion.obj", 49997, 99990, 49997, 1, 0, 0, 0},
      {"meshes/sofa/raptor_8kp.obj", 35264, 8816, 8818, 1, 0, 0, 0},
      {"meshes/sumner-popovic/camel_ref.obj", 21887, 43814, 21887, 1, 5, 26, 51},
      {"large/derived/armadillo_loop2.ply", 691858, 1383712, 691858, 1, 0, 0, 0},
      {"large/jaxa-itokawa/itokawa_200k.ply", 98306, 196608, 98306, 1, 0, 0, 0},
      {"large/stanford/dragon_vrip_res2.ply", 100250, 202520, 100207, 7, 0, 2534, 5068},
      {"bad/cgal/blobby_3cc.off", 1820, 3417, 1820, 3, 219, 0, 0},
      {"bad/cgal/elephant-with-holes.off", 2798, 4463, 2733, 1, 1353, 0, 0},
      {"bad/draco/non_manifold_wrap.obj", 10, 12, 10, 1, 8, 1, 2},
      {"bad/geometry-central/hourglass_ico.obj", 23, 40, 23, 1, 0, 0, 0},
      {"bad/geometry-central/moebius.obj", 280, 224, 280, 1, 112, 0, 4},
      {"bad/trimesh/negative_indices.obj", 24, 6, 8, 1, 0, 0, 0},
      {"bad/trimesh/soup.stl", 300, 100, 300, 100, 300, 0, 0}};
  for (const Figures& expected : table) {
    SCOPED_TRACE(expected.file);
    const MeshDiagnosis found = read_mesh(shared_data() / expected.file).diagnosis;
    EXPECT_EQ(found.source_vertices, expected.source_vertices);
    EXPECT_EQ(found.source_faces, expected.faces);
    EXPECT_EQ(found.welded_vertices, expected.welded_vertices);
    EXPECT_EQ(found.components, expected.components);
    EXPECT_EQ(found.boundary_edges, expected.boundary);
    EXPECT_EQ(found.non_manifold_edges, expected.non_manifold);
    EXPECT_EQ(found.inconsistent_edges, expected.inconsistent);
    EXPECT_EQ(found.closed, expected.boundary + expected.non_manifold == 0);
    EXPECT_EQ(found.degenerate_triangles, 0);
    EXPECT_TRUE(found.outward);
  }
}

TEST(ReadMesh, bad_files_of_others_are_refused_where_they_go_wrong_and_ugly_ones_load) {
  if (!std::filesystem::is_directory(shared_data())) GTEST_SKIP() << "no shared data at " << shared_data();
  const std::filesystem::path bad = shared_data() / "bad";
  const auto found = [&](const std::string& file) {
    std::string message = refusal([&] { read_mesh(bad / file); });
    if (message.starts_with(bad.string())) message = message.substr(bad.string().size() + 1);
    return message;
  };
  EXPECT_EQ(found("assimp/OutOfMemory.off"),
            "assimp/OutOfMemory.off:2: announces 353535235358 vertices; the 288 bytes that follow hold at most 57");
  EXPECT_EQ(found("assimp/crash-30d6d0f7c529b3b66b4131700b7a4580cd7082df.ply"),
            "assimp/crash-30d6d0f7c529b3b66b4131700b7a4580cd7082df.ply:7: type '?\?\?'; expected char, uchar, short, "
            "ushort, int, uint, float or double");
  EXPECT_EQ(found("assimp/invalid.off"), "assimp/invalid.off:7: face announces 2 corners and has 0");
  EXPECT_EQ(found("assimp/malformed.obj"), "assimp/malformed.obj:28: vertex index 0; OBJ counts from 1");
  EXPECT_EQ(found("draco/inf_nan.obj"), "draco/inf_nan.obj:1: 'inf' is not a finite number");
  for (const char* ugly : {"libigl/truck.obj", "manifold/openscad-nonmanifold-crash.obj"}) {
    EXPECT_EQ(found(ugly), "accepted") << ugly;
  }
}

TEST(ReadMesh, says_which_file_cannot_be_opened) {
  EXPECT_EQ(refusal([] { read_mesh("/nowhere/a.obj"); }), "/nowhere/a.obj: cannot open: No such file or directory");
}

}  // namespace
}  // namespace sinew
