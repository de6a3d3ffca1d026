#include "io/gltf_writer.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <functional>
#include <limits>

#include "io/file_error.h"
#include "tests/io/glb_decoder.h"
#include "tests/io/tube_asset.h"

namespace sinew {
namespace {

constexpr double kFramesPerSecond = 30.0;

/// Removed with all that was written when the tests end.
struct TemporaryFolder {
  TemporaryFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "sinew_gltf_XXXXXX").string();
    path = ::mkdtemp(name.data());
  }
  ~TemporaryFolder() { std::filesystem::remove_all(path); }
  std::filesystem::path path;
};

std::filesystem::path folder() {
  static const TemporaryFolder temporary;
  return temporary.path;
}

/// As the file has it: a float.
double key_time(int frame) {
  return static_cast<double>(static_cast<float>(frame / kFramesPerSecond));
}

using Clip = std::vector<Field3>;

Clip clip_of(const MeshAsset& asset, int frames) {
  Clip clip;
  for (int frame = 0; frame < frames; ++frame)
    clip.push_back(tube::moved(asset.mesh.positions, frame / kFramesPerSecond));
  return clip;
}

GltfWriteReport write(const MeshAsset& asset, const GltfWriterOptions& options, const Clip& clip,
                      const std::filesystem::path& path) {
  GltfWriter writer(asset, options);
  for (const Field3& frame : clip) writer.add_frame(frame);
  return writer.write(path);
}

/// Largest distance between the vertices shown at `time` and where `truth` puts them.
double farthest(const GlbDecoder& file, double time, const MeshAsset& asset, const Field3& truth) {
  const GlbDecoder::Shape shape = file.shape_at(time);
  EXPECT_EQ(shape.positions.size(), asset.vertex_of_source.size());
  double distance = 0.0;
  for (std::size_t row = 0; row < std::min(shape.positions.size(), asset.vertex_of_source.size()); ++row) {
    const int vertex = asset.vertex_of_source[row];
    if (vertex >= 0)
      distance = std::max(distance, (shape.positions[row] - truth.row(vertex).transpose()).norm());
  }
  return distance;
}

double diagonal(const MeshAsset& asset) {
  return bounds(asset.mesh).diagonal();
}

/// Area-weighted normals of the welded surface, unit, one a vertex.
Field3 vertex_normals(const TriMesh& mesh, const Field3& positions) {
  Field3 normals = Field3::Zero(positions.rows(), 3);
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3d normal = Eigen::Vector3d(positions.row(b) - positions.row(a))
                                       .cross(Eigen::Vector3d(positions.row(c) - positions.row(a)));
    for (const int vertex : {a, b, c}) normals.row(vertex) += normal.transpose();
  }
  normals.rowwise().normalize();
  return normals;
}

double degrees_between(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / std::numbers::pi;
}

double mean_normal_error(const GlbDecoder& file, double time, const MeshAsset& asset, const Field3& truth) {
  const Field3 expected = vertex_normals(asset.mesh, truth);
  const GlbDecoder::Shape shape = file.shape_at(time);
  EXPECT_EQ(shape.normals.size(), asset.vertex_of_source.size());
  double sum = 0.0;
  int count = 0;
  for (std::size_t row = 0; row < shape.normals.size(); ++row) {
    const int vertex = asset.vertex_of_source[row];
    if (vertex < 0) continue;
    sum += degrees_between(shape.normals[row], expected.row(vertex).transpose());
    ++count;
  }
  return sum / count;
}

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const std::exception& error) {
    return error.what();
  }
  return "nothing was thrown";
}

// ------------------------------------------------------------------------------------------ pca

TEST(GltfWriterPca, recovers_every_frame_within_the_error_it_reports) {
  const MeshAsset asset = tube::asset();
  const Clip clip = clip_of(asset, 50);
  const auto path = folder() / "pca.glb";
  const GltfWriteReport report = write(asset, {.tolerance = 1e-3}, clip, path);
  EXPECT_LE(report.p999_error, 1e-3);
  EXPECT_GT(report.targets, 3);
  EXPECT_LT(report.targets, 40);
  EXPECT_EQ(report.bytes, static_cast<std::int64_t>(std::filesystem::file_size(path)));
  const GlbDecoder file(path);
  double worst = 0.0;
  for (int frame = 0; frame < 50; ++frame)
    worst = std::max(worst, farthest(file, key_time(frame), asset, clip[static_cast<std::size_t>(frame)]));
  EXPECT_NEAR(worst / diagonal(asset), report.max_error, 1e-6);
}

TEST(GltfWriterPca, takes_no_more_targets_than_the_tolerance_needs) {
  const MeshAsset asset = tube::asset();
  const Clip clip = clip_of(asset, 50);
  const auto path = folder() / "fewest.glb";
  const GltfWriteReport enough = write(asset, {.tolerance = 1e-3}, clip, path);
  const GltfWriteReport fewer =
      write(asset, {.max_targets = enough.targets - 1, .tolerance = 1e-3}, clip, path);
  EXPECT_EQ(fewer.targets, enough.targets - 1);
  EXPECT_GT(fewer.p999_error, 1e-3);
}

TEST(GltfWriterPca, stays_below_the_limit_of_targets_when_the_tolerance_cannot_be_met) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "limit.glb";
  Clip clip = clip_of(asset, 100);
  // Shaking of its own at every vertex and frame: as many components as frames.
  for (std::size_t frame = 0; frame < clip.size(); ++frame)
    for (Eigen::Index i = 0; i < clip[frame].size(); ++i)
      clip[frame].data()[i] +=
          0.01 * std::sin(static_cast<double>(frame * frame + 7) * static_cast<double>(i + 1));
  EXPECT_EQ(write(asset, {.tolerance = 0.0}, clip, path).targets, 63);
  EXPECT_EQ(write(asset, {.max_targets = 5, .tolerance = 0.0}, clip, path).targets, 5);
}

TEST(GltfWriterPca, keeps_weights_within_zero_and_one) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "weights.glb";
  write(asset, {}, clip_of(asset, 40), path);
  const GlbDecoder file(path);
  const auto& animation = file.json["animations"][0];
  int seen = 0;
  for (const auto& channel : animation["channels"]) {
    if (channel["target"]["path"] != "weights") continue;
    for (const double weight : file.values(animation["samplers"][channel["sampler"].get<int>()]["output"])) {
      EXPECT_GE(weight, 0.0);
      EXPECT_LE(weight, 1.0);
      ++seen;
    }
  }
  EXPECT_GT(seen, 0);
}

TEST(GltfWriterPca, needs_no_targets_for_rigid_motion) {
  const MeshAsset asset = tube::asset();
  Clip clip;
  for (int frame = 0; frame < 30; ++frame) {
    const Eigen::Matrix3d turn =
        Eigen::AngleAxisd(0.3 * frame, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
    clip.push_back(asset.mesh.positions * turn.transpose());
    clip.back().rowwise() += Eigen::RowVector3d(0.2 * frame, 1.0, -0.1 * frame);
  }
  const auto path = folder() / "rigid.glb";
  const GltfWriteReport report = write(asset, {}, clip, path);
  EXPECT_EQ(report.targets, 0);
  EXPECT_LT(report.max_error, 1e-6);
  const GlbDecoder file(path);
  for (int frame = 0; frame < 30; ++frame)
    EXPECT_LT(farthest(file, key_time(frame), asset, clip[static_cast<std::size_t>(frame)]), 1e-5);
}

TEST(GltfWriterPca, turns_its_node_without_jumps) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "turns.glb";
  write(asset, {}, clip_of(asset, 120), path);
  const GlbDecoder file(path);
  const auto& animation = file.json["animations"][0];
  for (const auto& channel : animation["channels"]) {
    if (channel["target"]["path"] != "rotation") continue;
    const auto keys = file.values(animation["samplers"][channel["sampler"].get<int>()]["output"]);
    for (std::size_t i = 4; i < keys.size(); i += 4) {
      double cosine = 0.0;
      for (std::size_t c = 0; c < 4; ++c) cosine += keys[i + c] * keys[i - 4 + c];
      EXPECT_GT(cosine, 0.9);
    }
  }
}

TEST(GltfWriterPca, shows_the_rest_shape_when_nothing_plays) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "rest.glb";
  write(asset, {}, clip_of(asset, 20), path);
  GlbDecoder file(path);
  file.json.erase("animations");
  EXPECT_LT(farthest(file, 0.0, asset, asset.mesh.positions), 1e-7);
}

TEST(GltfWriterPca, morph_normals_follow_the_motion) {
  const MeshAsset asset = tube::asset();
  const Clip clip = clip_of(asset, 50);
  const auto path = folder() / "normals.glb";
  write(asset, {.tolerance = 1e-4}, clip, path);
  const GlbDecoder file(path);
  for (const int frame : {0, 13, 26, 49})
    EXPECT_LT(mean_normal_error(file, key_time(frame), asset, clip[static_cast<std::size_t>(frame)]), 1.5);
}

// ---------------------------------------------------------------------------------------- exact

class GltfWriterExact : public testing::TestWithParam<int> {};

TEST_P(GltfWriterExact, recovers_every_key_and_the_way_between) {
  const int frames = GetParam();
  const MeshAsset asset = tube::asset(true, 3, 5);
  const Clip clip = clip_of(asset, frames);
  const auto path = folder() / ("exact" + std::to_string(frames) + ".glb");
  const GltfWriteReport report = write(asset, {.kind = GltfKind::exact}, clip, path);
  EXPECT_EQ(report.targets, frames);
  EXPECT_LT(report.max_error, 1e-6);
  const GlbDecoder file(path);
  for (const auto& mesh : file.json["meshes"])
    for (const auto& primitive : mesh["primitives"]) EXPECT_LE(primitive["targets"].size(), 63U);
  for (int frame = 0; frame < frames; ++frame) {
    const Field3& truth = clip[static_cast<std::size_t>(frame)];
    EXPECT_LT(farthest(file, key_time(frame), asset, truth), 2e-6) << "frame " << frame;
    if (frame + 1 == frames) break;
    const Field3 between = 0.5 * (truth + clip[static_cast<std::size_t>(frame) + 1]);
    EXPECT_LT(farthest(file, 0.5 * (key_time(frame) + key_time(frame + 1)), asset, between), 2e-6)
        << "after frame " << frame;
  }
}
INSTANTIATE_TEST_SUITE_P(around_the_chunk_of_63, GltfWriterExact,
                         testing::Values(1, 2, 62, 63, 64, 125, 126, 130));

TEST(GltfWriterExactKind, drops_keys_only_where_interpolation_gives_them) {
  const MeshAsset asset = tube::asset(true, 3, 5);
  Clip clip;
  for (int frame = 0; frame < 90; ++frame) clip.push_back(tube::moved(asset.mesh.positions, frame / 150.0));
  const auto path = folder() / "keys.glb";
  const double tolerance = 1e-3;
  const GltfWriteReport report =
      write(asset, {.kind = GltfKind::exact, .key_tolerance = tolerance}, clip, path);
  EXPECT_LT(report.targets, 60);
  EXPECT_LE(report.max_error, tolerance * 1.0001);
  const GlbDecoder file(path);
  double worst = 0.0;
  for (int frame = 0; frame < 90; ++frame)
    worst = std::max(worst, farthest(file, key_time(frame), asset, clip[static_cast<std::size_t>(frame)]));
  EXPECT_NEAR(worst / diagonal(asset), report.max_error, 1e-5);
}

TEST(GltfWriterExactKind, keeps_few_keys_of_a_straight_motion) {
  const MeshAsset asset = tube::asset(true, 3, 5);
  Clip clip;
  for (int frame = 0; frame < 129; ++frame) {
    clip.push_back(asset.mesh.positions);
    clip.back().col(0).array() += 0.01 * frame;
  }
  const auto path = folder() / "straight.glb";
  EXPECT_EQ(write(asset, {.kind = GltfKind::exact, .key_tolerance = 1e-5}, clip, path).targets, 3);
}

TEST(GltfWriterExactKind, morph_normals_are_the_true_ones_at_keys) {
  const MeshAsset asset = tube::asset(false);
  const Clip clip = clip_of(asset, 12);
  const auto path = folder() / "exact_normals.glb";
  write(asset, {.kind = GltfKind::exact}, clip, path);
  const GlbDecoder file(path);
  for (const int frame : {0, 5, 11})
    EXPECT_LT(mean_normal_error(file, key_time(frame), asset, clip[static_cast<std::size_t>(frame)]), 1e-3);
}

TEST(GltfWriterExactKind, hard_edges_stay_hard) {
  // Two triangles fold along an edge; each row carries its own face's normal.
  MeshAsset asset;
  asset.source_positions.resize(6, 3);
  asset.source_positions << 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, -1, 0.5, 0;
  SourcePrimitive primitive;
  primitive.name = "fold";
  primitive.vertex_count = 6;
  primitive.indices = {0, 2, 1, 3, 5, 4};
  std::vector<float> normals;
  for (int face = 0; face < 2; ++face) {
    const Eigen::Vector3d a = asset.source_positions.row(face == 0 ? 0 : 3);
    const Eigen::Vector3d b = asset.source_positions.row(face == 0 ? 2 : 5);
    const Eigen::Vector3d c = asset.source_positions.row(face == 0 ? 1 : 4);
    const Eigen::Vector3f normal = (b - a).cross(c - a).normalized().cast<float>();
    for (int corner = 0; corner < 3; ++corner)
      normals.insert(normals.end(), normal.data(), normal.data() + 3);
  }
  primitive.attributes.push_back(tube::attribute("NORMAL", 5126, 3, false, normals));
  asset.primitives.push_back(primitive);
  weld_and_diagnose(asset);
  Field3 folded = asset.mesh.positions;
  folded(asset.vertex_of_source[5], 1) = -2.0;
  const auto path = folder() / "fold.glb";
  write(asset, {.kind = GltfKind::exact}, {folded}, path);
  const GlbDecoder::Shape shape = GlbDecoder(path).shape_at(0.0);
  const Eigen::Vector3d still(0, 1, 0);
  const Eigen::Vector3d turned = Eigen::Vector3d(-1, -2, 0).cross(Eigen::Vector3d(0, 0, 1)).normalized();
  for (std::size_t row = 0; row < 3; ++row) EXPECT_LT(degrees_between(shape.normals[row], still), 1e-3);
  for (std::size_t row = 3; row < 6; ++row) EXPECT_LT(degrees_between(shape.normals[row], turned), 1e-3);
}

// --------------------------------------------------------------------------------- both kinds

class GltfWriterBothKinds : public testing::TestWithParam<GltfKind> {};
INSTANTIATE_TEST_SUITE_P(kinds, GltfWriterBothKinds, testing::Values(GltfKind::pca, GltfKind::exact),
                         [](const auto& kind) { return kind.param == GltfKind::pca ? "pca" : "exact"; });

TEST_P(GltfWriterBothKinds, attributes_indices_and_materials_survive_to_the_byte) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "survive.glb";
  write(asset, {.kind = GetParam()}, clip_of(asset, 3), path);
  const GlbDecoder file(path);
  ASSERT_EQ(file.json["meshes"].size(), 2U);
  for (std::size_t p = 0; p < 2; ++p) {
    const SourcePrimitive& source = asset.primitives[p];
    EXPECT_EQ(file.json["meshes"][p]["name"], source.name);
    const auto& primitive = file.json["meshes"][p]["primitives"][0];
    EXPECT_EQ(primitive["material"], source.material);
    const std::vector<double> indices = file.values(primitive["indices"]);
    EXPECT_EQ(std::vector<std::uint32_t>(indices.begin(), indices.end()), source.indices);
    for (const VertexAttribute& attribute : source.attributes) {
      if (attribute.name == "NORMAL") continue;
      const int accessor = primitive["attributes"][attribute.name];
      EXPECT_EQ(file.json["accessors"][accessor].value("normalized", false), attribute.normalized);
      std::string bytes;
      for (int i = 0; i < source.vertex_count; ++i) bytes += file.element(accessor, i);
      const std::string expected(reinterpret_cast<const char*>(attribute.data.data()), attribute.data.size());
      EXPECT_EQ(bytes, expected) << attribute.name;
    }
  }
  const auto appearance = nlohmann::json::parse(asset.appearance_json);
  for (const char* list : {"materials", "textures", "samplers", "extensionsUsed"})
    EXPECT_EQ(file.json[list], appearance[list]);
  EXPECT_EQ(file.json["images"][0]["mimeType"], "image/png");
  const std::string image = file.view_bytes(file.json["images"][0]["bufferView"]);
  const auto& source = asset.images[0].bytes;
  EXPECT_EQ(image.substr(0, source.size()),
            std::string(reinterpret_cast<const char*>(source.data()), source.size()));
}

TEST_P(GltfWriterBothKinds, normals_at_rest_are_the_sources) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "rest_normals.glb";
  write(asset, {.kind = GetParam()}, clip_of(asset, 3), path);
  const GlbDecoder file(path);
  const auto normals = file.values(file.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"]);
  const auto& source = asset.primitives[0].attributes[0].data;
  std::vector<float> expected(source.size() / 4);
  std::memcpy(expected.data(), source.data(), source.size());
  ASSERT_EQ(normals.size(), expected.size());
  for (std::size_t i = 0; i < normals.size(); ++i)
    EXPECT_FLOAT_EQ(static_cast<float>(normals[i]), expected[i]);
}

TEST_P(GltfWriterBothKinds, a_mesh_without_normals_gets_smooth_unit_ones) {
  const MeshAsset asset = tube::asset(false);
  const auto path = folder() / "smooth.glb";
  const Clip clip = {asset.mesh.positions};
  write(asset, {.kind = GetParam()}, clip, path);
  EXPECT_LT(mean_normal_error(GlbDecoder(path), 0.0, asset, clip[0]), 1e-3);
}

TEST_P(GltfWriterBothKinds, normals_can_be_left_out) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "flat.glb";
  write(asset, {.kind = GetParam(), .normals = false}, clip_of(asset, 3), path);
  EXPECT_TRUE(GlbDecoder(path).shape_at(0.0).normals.empty());
}

TEST_P(GltfWriterBothKinds, a_still_clip_stands_still) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "still.glb";
  for (const std::size_t frames : {1U, 2U, 70U}) {
    const GltfWriteReport report =
        write(asset, {.kind = GetParam()}, Clip(frames, asset.mesh.positions), path);
    EXPECT_LT(report.max_error, 1e-7);
    const GlbDecoder file(path);
    for (const int frame : {0, static_cast<int>(frames) - 1})
      EXPECT_LT(farthest(file, key_time(frame), asset, asset.mesh.positions), 1e-6);
  }
}

TEST_P(GltfWriterBothKinds, one_bent_frame_is_recovered) {
  const MeshAsset asset = tube::asset();
  const Clip clip = {tube::moved(asset.mesh.positions, 0.4)};
  const auto path = folder() / "one.glb";
  EXPECT_EQ(write(asset, {.kind = GetParam()}, clip, path).targets, 1);
  EXPECT_LT(farthest(GlbDecoder(path), 0.0, asset, clip[0]), 2e-6);
}

TEST_P(GltfWriterBothKinds, same_frames_give_the_same_bytes_under_any_name) {
  const MeshAsset asset = tube::asset();
  const Clip clip = clip_of(asset, 70);
  write(asset, {.kind = GetParam()}, clip, folder() / "first.glb");
  write(asset, {.kind = GetParam()}, clip, folder() / "second.glb");
  EXPECT_EQ(GlbDecoder(folder() / "first.glb").bytes(), GlbDecoder(folder() / "second.glb").bytes());
}

TEST_P(GltfWriterBothKinds, a_mesh_of_many_vertices_gets_wide_indices) {
  const MeshAsset asset = tube::asset(false, 300, 130);
  const auto path = folder() / "wide.glb";
  MeshAsset one = asset;
  one.appearance_json.clear();
  SourcePrimitive& primitive = one.primitives[0];
  for (std::uint32_t index : asset.primitives[1].indices)
    primitive.indices.push_back(index + static_cast<std::uint32_t>(primitive.vertex_count));
  primitive.vertex_count = static_cast<int>(one.vertex_of_source.size());
  primitive.attributes.clear();
  one.primitives.resize(1);
  write(one, {.kind = GetParam(), .normals = false}, {one.mesh.positions}, path);
  const GlbDecoder file(path);
  const int accessor = file.json["meshes"][0]["primitives"][0]["indices"];
  EXPECT_EQ(file.json["accessors"][accessor]["componentType"], 5125);
  const std::vector<double> indices = file.values(accessor);
  EXPECT_EQ(std::vector<std::uint32_t>(indices.begin(), indices.end()), primitive.indices);
  EXPECT_EQ(file.json["materials"][0]["name"], "matt");
}

TEST_P(GltfWriterBothKinds, a_file_above_the_limit_is_refused_before_it_is_written) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "large.glb";
  const GltfWriterOptions options{.kind = GetParam(), .tolerance = 1e-6, .max_bytes = 20'000};
  const std::string message = message_of([&] { write(asset, options, clip_of(asset, 30), path); });
  EXPECT_NE(message.find("morph targets make a file of"), std::string::npos) << message;
  EXPECT_NE(message.find("expected at most 0 MB (a sequence of OBJ files has no such limit)"),
            std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_P(GltfWriterBothKinds, a_clip_without_frames_is_refused) {
  const MeshAsset asset = tube::asset();
  EXPECT_EQ(message_of([&] { write(asset, {.kind = GetParam()}, {}, folder() / "none.glb"); }),
            "GltfWriter::write: no frames were added");
}

TEST_P(GltfWriterBothKinds, a_folder_that_does_not_exist_is_named) {
  const MeshAsset asset = tube::asset();
  const auto path = folder() / "nowhere" / "a.glb";
  const std::string message =
      message_of([&] { write(asset, {.kind = GetParam()}, {asset.mesh.positions}, path); });
  EXPECT_TRUE(message.starts_with(path.string() + ": ")) << message;
}

// ------------------------------------------------------------------------------------- refusals

TEST(GltfWriterRefuses, frames_that_are_short_or_not_finite) {
  const MeshAsset asset = tube::asset(true, 3, 5);
  GltfWriter writer(asset, {});
  const int count = asset.mesh.vertex_count();
  EXPECT_EQ(message_of([&] { writer.add_frame(asset.mesh.positions.topRows(count - 1)); }),
            "GltfWriter::add_frame: frame 0 has " + std::to_string(count - 1) +
                " positions; expected at least " + std::to_string(count));
  Field3 broken = asset.mesh.positions;
  broken(2, 1) = std::numeric_limits<double>::quiet_NaN();
  writer.add_frame(asset.mesh.positions);
  EXPECT_EQ(message_of([&] { writer.add_frame(broken); }),
            "GltfWriter::add_frame: frame 1 has a position that is not finite");
}

TEST(GltfWriterRefuses, options_out_of_range) {
  const MeshAsset asset = tube::asset(true, 3, 5);
  EXPECT_EQ(message_of([&] { GltfWriter(asset, {.max_targets = 64}); }),
            "GltfWriter: max_targets is 64; expected 2 to 63");
  EXPECT_EQ(message_of([&] { GltfWriter(asset, {.max_targets = 1}); }),
            "GltfWriter: max_targets is 1; expected 2 to 63");
  EXPECT_EQ(message_of([&] { GltfWriter(asset, {.frames_per_second = 0.0}); }),
            "GltfWriter: frames per second is 0.000000; expected above 0");
}

TEST(GltfWriterRefuses, an_asset_whose_parts_do_not_fit) {
  MeshAsset asset = tube::asset(true, 3, 5);
  asset.primitives[0].indices[4] = 99;
  EXPECT_EQ(message_of([&] { GltfWriter(asset, {}); }),
            "GltfWriter: primitive 'leg' has index 99; expected below 18");
  asset = tube::asset(true, 3, 5);
  asset.primitives[0].attributes[1].data.pop_back();
  EXPECT_EQ(message_of([&] { GltfWriter(asset, {}); }),
            "GltfWriter: primitive 'leg' has 143 bytes of TEXCOORD_0; expected 144");
  asset = tube::asset(true, 3, 5);
  asset.primitives[0].material = 2;
  EXPECT_EQ(message_of([&] { write(asset, {}, {asset.mesh.positions}, folder() / "material.glb"); }),
            "GltfWriter: primitive 'leg' has material 2; there are 2");
}

TEST(GltfWriterWarns, about_tangents_that_stay_as_they_are) {
  MeshAsset asset = tube::asset(true, 3, 5);
  std::vector<float> tangents;
  for (int i = 0; i < asset.primitives[0].vertex_count; ++i) tangents.insert(tangents.end(), {0, 1, 0, 1});
  asset.primitives[0].attributes.push_back(tube::attribute("TANGENT", 5126, 4, false, tangents));
  const GltfWriteReport report = write(asset, {}, {asset.mesh.positions}, folder() / "tangents.glb");
  ASSERT_EQ(report.warnings.size(), 1U);
  EXPECT_TRUE(report.warnings[0].starts_with("W_GLTF_STATIC_TANGENTS: "));
}

// ------------------------------------------------------------------------------ the validator

TEST(GltfValidator, finds_no_fault_in_what_is_written) {
  const std::filesystem::path files = folder() / "validated";
  std::filesystem::create_directory(files);
  const MeshAsset asset = tube::asset();
  MeshAsset plain = tube::asset(false);
  plain.appearance_json.clear();
  for (const GltfKind kind : {GltfKind::pca, GltfKind::exact}) {
    const std::string name = kind == GltfKind::pca ? "pca" : "exact";
    for (const int frames : {1, 2, 64, 130})
      write(asset, {.kind = kind}, clip_of(asset, frames), files / (name + std::to_string(frames) + ".glb"));
    write(plain, {.kind = kind}, clip_of(plain, 5), files / (name + "_plain.glb"));
    write(plain, {.kind = kind, .normals = false}, clip_of(plain, 5), files / (name + "_flat.glb"));
    write(asset, {.kind = kind}, Clip(3, asset.mesh.positions), files / (name + "_still.glb"));
  }
  const std::filesystem::path log = files / "log.txt";
  const std::string command = "node '" SINEW_SOURCE_DIR "/tools/web/validate.mjs' '" + files.string() +
                              "'/*.glb > '" + log.string() + "' 2>&1";
  const int status = std::system(command.c_str());
  const int code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  if (code == 77 || code == 127) GTEST_SKIP() << "node or the npm module gltf-validator is not installed";
  std::ifstream text(log);
  const std::string said(std::istreambuf_iterator<char>(text), {});
  EXPECT_EQ(code, 0) << said;
  std::size_t clean = 0;
  for (std::size_t at = 0; (at = said.find(": 0 errors, 0 warnings,", at)) != std::string::npos; ++at)
    ++clean;
  EXPECT_EQ(clean, 14U) << said;
}

}  // namespace
}  // namespace sinew
