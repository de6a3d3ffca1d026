#include <gtest/gtest.h>
#include <sys/stat.h>

#include <algorithm>
#include <functional>

#include "io/file_error.h"
#include "io/gltf_folder.h"
#include "io/gltf_reader.h"
#include "tests/io/plain_gltf.h"
#include "tests/io/small_gltf.h"

namespace sinew {
namespace {

using small_gltf::File;
using small_gltf::Json;
using small_gltf::ribbon;
using small_gltf::TemporaryFolder;
using small_gltf::triangle;

/// Asks a file for all it can give.
void use_all_of(const std::filesystem::path& path) {
  const GltfFile gltf(path);
  gltf.skins();
  gltf.rig();
  if (!gltf.animations().empty()) {
    gltf.clip("0", 30);
    gltf.skinned_positions("0", 0.5);
    if (gltf.rig()) gltf.motion("0", 30);
  }
  gltf.mesh();
}

struct Refusal {
  int fault = 0;     ///< 0: not refused
  std::string text;  ///< without the folder
};

/// What is said about a file; anything but a FileError escapes and fails the test.
Refusal refusal_of(const std::filesystem::path& path) {
  try {
    use_all_of(path);
    return {};
  } catch (const FileError& error) {
    std::string text = error.what();
    const std::string folder = path.parent_path().string() + "/";
    for (std::size_t at; (at = text.find(folder)) != std::string::npos;) text.erase(at, folder.size());
    EXPECT_EQ(text.find('\n'), std::string::npos) << text;
    return {static_cast<int>(error.fault()), text};
  }
}

Refusal refusal_of_bytes(const std::string& bytes) {
  const TemporaryFolder folder;
  return refusal_of(folder.write("bad.glb", bytes));
}

/// The ribbon with a rotation of its tip and a stepped scale of its root.
File animated() {
  File file = ribbon();
  file.animate(0, 2, "rotation", {0, 1}, {0, 0, 0, 1, 0, 0, 1, 0});
  file.animate(0, 1, "scale", {0, 0.5f}, {1, 1, 1, 2, 2, 2}, "STEP");
  return file;
}

// Indices of the accessors in animated(): positions 0, joints 1, weights 2, indices 3, bind matrices 4,
// then times and values of both channels.
struct Damage {
  const char* what;
  std::function<void(File&)> inflict;
  int fault;
  const char* text;
};

void set_float(File& file, int accessor, std::size_t index, float value) {
  const std::size_t view = file.json["accessors"][accessor]["bufferView"];
  const std::size_t offset = file.json["bufferViews"][view]["byteOffset"];
  std::memcpy(file.binary.data() + offset + 4 * index, &value, 4);
}

const std::vector<Damage>& damages() {
  static const std::vector<Damage> table = {
      {"no asset", [](File& f) { f.json.erase("asset"); }, 3, "bad.glb:/: 'asset' is missing"},
      {"glTF 1", [](File& f) { f.json["asset"]["version"] = "1.0"; }, 4,
       "bad.glb:/asset/version: glTF version '1.0'; expected 2.0"},
      {"a required extension", [](File& f) { f.json["extensionsRequired"] = {"KHR_draco_mesh_compression"}; },
       4,
       "bad.glb:/extensionsRequired/0: needs the extension 'KHR_draco_mesh_compression', which is not "
       "supported"},
      {"a string for a number", [](File& f) { f.json["accessors"][0]["count"] = "6"; }, 3,
       "bad.glb:/accessors/0/count: found string, expected a whole number, 0 or more"},
      {"a fraction for a count", [](File& f) { f.json["accessors"][0]["count"] = 6.5; }, 3,
       "bad.glb:/accessors/0/count: found 6.5, expected a whole number, 0 or more"},
      {"a negative offset", [](File& f) { f.json["accessors"][0]["byteOffset"] = -4; }, 3,
       "bad.glb:/accessors/0/byteOffset: found -4, expected a whole number, 0 or more"},
      {"an object for an array", [](File& f) { f.json["nodes"] = Json::object(); }, 3,
       "bad.glb:/nodes: found object, expected an array"},
      {"a number for an object", [](File& f) { f.json["meshes"][0] = 7; }, 3,
       "bad.glb:/meshes/0: found number, expected an object"},
      {"a name that is no text", [](File& f) { f.json["nodes"][0]["name"] = 1; }, 3,
       "bad.glb:/nodes/0/name: found number, expected a string"},
      {"a count that wraps around", [](File& f) { f.json["accessors"][0]["count"] = std::uint64_t{1} << 62; },
       3,
       "bad.glb:/accessors/0: 4611686018427387904 elements of 12 bytes from byte 0 do not fit the 72 bytes "
       "of "
       "bad.glb:/bufferViews/0"},
      {"an offset that wraps around",
       [](File& f) { f.json["accessors"][0]["byteOffset"] = ~std::uint64_t{7}; }, 3,
       "bad.glb:/accessors/0: 6 elements of 12 bytes from byte 18446744073709551608 do not fit the 72 bytes "
       "of "
       "bad.glb:/bufferViews/0"},
      {"a view that wraps around",
       [](File& f) { f.json["bufferViews"][0]["byteOffset"] = ~std::uint64_t{7}; }, 3, nullptr},
      {"a view beyond its buffer", [](File& f) { f.json["bufferViews"][0]["byteLength"] = 100000; }, 3,
       nullptr},
      {"a buffer beyond the chunk",
       [](File& f) {
         f.json["buffers"] = {{{"byteLength", 1 << 20}}};
       },
       3, nullptr},
      {"an empty buffer",
       [](File& f) {
         f.json["buffers"] = {{{"byteLength", 0}}};
       },
       3, "bad.glb:/buffers/0/byteLength: found 0, expected 1 or more"},
      {"a view of no buffer", [](File& f) { f.json["bufferViews"][0]["buffer"] = 9; }, 3,
       "bad.glb:/bufferViews/0/buffer: index 9 is out of range; the file has 1 buffers"},
      {"stride 0", [](File& f) { f.json["bufferViews"][0]["byteStride"] = 0; }, 3,
       "bad.glb:/bufferViews/0/byteStride: found 0, expected a multiple of 4 from 4 to 252"},
      {"stride 253", [](File& f) { f.json["bufferViews"][0]["byteStride"] = 253; }, 3, nullptr},
      {"stride below the element", [](File& f) { f.json["bufferViews"][0]["byteStride"] = 4; }, 3,
       "bad.glb:/accessors/0: elements of 12 bytes in a view with byteStride 4"},
      {"a stride that leads out", [](File& f) { f.json["bufferViews"][0]["byteStride"] = 252; }, 3, nullptr},
      {"component type 5124", [](File& f) { f.json["accessors"][0]["componentType"] = 5124; }, 3,
       "bad.glb:/accessors/0/componentType: found 5124, not a glTF type"},
      {"type VEC5", [](File& f) { f.json["accessors"][0]["type"] = "VEC5"; }, 3, nullptr},
      {"a billion zeros",
       [](File& f) {
         f.json["accessors"][0].erase("bufferView");
         f.json["accessors"][0]["count"] = 1000000000;
       },
       6,
       "bad.glb:/accessors/0: 1000000000 elements without a buffer view; at most 67108864 zero bytes are "
       "made"},
      {"a sparse index too large",
       [](File& f) {
         const int index = f.add<std::uint8_t>("SCALAR", 5121, {6});
         f.json["accessors"][0]["sparse"] = {{"count", 1},
                                             {"indices", {{"bufferView", index}, {"componentType", 5121}}},
                                             {"values", {{"bufferView", 0}}}};
       },
       3, "bad.glb:/accessors/0/sparse/indices: index 6 is out of range; the accessor has 6 elements"},
      {"more sparse values than elements",
       [](File& f) {
         f.json["accessors"][0]["sparse"] = {{"count", 7},
                                             {"indices", {{"bufferView", 0}, {"componentType", 5121}}},
                                             {"values", {{"bufferView", 0}}}};
       },
       3, "bad.glb:/accessors/0/sparse/count: found 7, expected 1 to 6"},
      {"sparse values out of their view",
       [](File& f) {
         f.json["accessors"][0]["sparse"] = {{"count", 6},
                                             {"indices", {{"bufferView", 0}, {"componentType", 5125}}},
                                             {"values", {{"bufferView", 0}, {"byteOffset", 4}}}};
       },
       3, nullptr},
      {"an attribute of another length",
       [](File& f) { f.json["meshes"][0]["primitives"][0]["attributes"]["_X"] = 4; }, 3,
       "bad.glb:/meshes/0/primitives/0/attributes/_X: accessor has 2 elements; POSITION has 6"},
      {"positions of the wrong shape",
       [](File& f) { f.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 2; }, 3,
       "bad.glb:/meshes/0/primitives/0/attributes/POSITION: accessor is VEC4 of type 5126; expected VEC3 of "
       "floats "
       "or quantized"},
      {"a position that is not a number", [](File& f) { set_float(f, 0, 4, std::nanf("")); }, 3,
       "bad.glb:/accessors/0: element 1 is not finite"},
      {"an index too large", [](File& f) { f.binary[f.json["bufferViews"][3]["byteOffset"]] = 6; }, 3,
       "bad.glb:/meshes/0/primitives/0/indices: index 6 at place 0 is out of range; the primitive has 6 "
       "vertices"},
      {"a joint too large", [](File& f) { f.binary[f.json["bufferViews"][1]["byteOffset"]] = 2; }, 3,
       "bad.glb:/meshes/0/primitives/0/attributes/JOINTS_0: vertex 0 names joint 2; the skin has 2"},
      {"a negative weight", [](File& f) { set_float(f, 2, 0, -1); }, 3,
       "bad.glb:/meshes/0/primitives/0/attributes/WEIGHTS_0: vertex 0 has a negative weight"},
      {"mode 7", [](File& f) { f.json["meshes"][0]["primitives"][0]["mode"] = 7; }, 3, nullptr},
      {"a material that is not there", [](File& f) { f.json["meshes"][0]["primitives"][0]["material"] = 0; },
       3, nullptr},
      {"only points", [](File& f) { f.json["meshes"][0]["primitives"][0]["mode"] = 0; }, 4,
       "bad.glb: the scene has no triangles"},
      {"a node that is its own grandparent", [](File& f) { f.json["nodes"][2]["children"] = {1}; }, 3,
       "bad.glb:/nodes/2: is its own ancestor"},
      {"a node with two parents", [](File& f) { f.json["nodes"][0]["children"] = {2}; }, 3,
       "bad.glb:/nodes/1/children/0: node 2 already is a child of node 0"},
      {"a child that is not there", [](File& f) { f.json["nodes"][0]["children"] = {3}; }, 3, nullptr},
      {"a matrix of 15 numbers", [](File& f) { f.json["nodes"][0]["matrix"] = std::vector<int>(15, 1); }, 3,
       "bad.glb:/nodes/0/matrix: found 15 numbers, expected 16"},
      {"a projective matrix", [](File& f) { f.json["nodes"][0]["matrix"] = std::vector<int>(16, 1); }, 3,
       "bad.glb:/nodes/0/matrix: the last row is not 0 0 0 1"},
      {"a rotation without length",
       [](File& f) {
         f.json["nodes"][0]["rotation"] = {0, 0, 0, 0};
       },
       3, "bad.glb:/nodes/0/rotation: quaternion has no length"},
      {"a place beyond all numbers",
       [](File& f) {
         f.json["nodes"][1]["translation"] = f.json["nodes"][2]["translation"] = {1.7e308, 0, 0};
       },
       3, "bad.glb:/animations/0: a joint of frame 0 is not finite"},
      {"a scene of a child", [](File& f) { f.json["scenes"][0]["nodes"] = {2}; }, 3,
       "bad.glb:/scenes/0/nodes/0: node 2 is not a root"},
      {"a scene that is not there", [](File& f) { f.json["scene"] = 1; }, 3, nullptr},
      {"a joint that is not there",
       [](File& f) {
         f.json["skins"][0]["joints"] = {1, 9};
       },
       3, nullptr},
      {"a skin without joints", [](File& f) { f.json["skins"][0]["joints"] = Json::array(); }, 3, nullptr},
      {"too few bind matrices",
       [](File& f) {
         f.json["skins"][0]["joints"] = {1, 2, 0};
       },
       3, "bad.glb:/skins/0/inverseBindMatrices: accessor has 2 matrices for 3 joints"},
      {"a skin that is not there", [](File& f) { f.json["nodes"][0]["skin"] = 1; }, 3, nullptr},
      {"key times that go back", [](File& f) { set_float(f, 5, 1, 0); }, 3,
       "bad.glb:/animations/0/samplers/0/input: key time 1 is not later than the one before"},
      {"a negative key time", [](File& f) { set_float(f, 5, 0, -1); }, 3,
       "bad.glb:/animations/0/samplers/0/input: the first key time is negative"},
      {"a key time of 1e30", [](File& f) { set_float(f, 5, 1, 1e30f); }, 6, nullptr},
      {"a rotation key without length", [](File& f) { set_float(f, 6, 3, 0); }, 3,
       "bad.glb:/animations/0/samplers/0/output: rotation 0 has no length"},
      {"values that do not match the keys",
       [](File& f) { f.json["animations"][0]["samplers"][0]["interpolation"] = "CUBICSPLINE"; }, 3,
       "bad.glb:/animations/0/samplers/0/output: accessor has 2 values for 2 keys, expected 3 a key"},
      {"an unknown interpolation",
       [](File& f) { f.json["animations"][0]["samplers"][0]["interpolation"] = "EASE"; }, 3,
       "bad.glb:/animations/0/samplers/0/interpolation: found 'EASE', expected LINEAR, STEP or CUBICSPLINE"},
      {"a target twice",
       [](File& f) {
         Json& channels = f.json["animations"][0]["channels"];
         const Json first = channels[0];
         channels.push_back(first);
       },
       3, "bad.glb:/animations/0/channels/2/target: a second channel for the rotation of node 2"},
      {"a moved matrix",
       [](File& f) { f.json["nodes"][1]["matrix"] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}; }, 3,
       "bad.glb:/animations/0/channels/1/target: moves node 1, which has a matrix; expected translation, "
       "rotation, scale"},
      {"a sampler that is not there", [](File& f) { f.json["animations"][0]["channels"][0]["sampler"] = 2; },
       3, nullptr},
      {"a target that is not there",
       [](File& f) { f.json["animations"][0]["channels"][0]["target"]["node"] = 3; }, 3, nullptr},
      {"an input that is not there", [](File& f) { f.json["animations"][0]["samplers"][0]["input"] = 99; }, 3,
       nullptr},
      {"a path that is none",
       [](File& f) { f.json["animations"][0]["channels"][0]["target"]["path"] = "color"; }, 3, nullptr},
  };
  return table;
}

TEST(GltfBadInput, the_undamaged_file_is_accepted) {
  EXPECT_EQ(refusal_of_bytes(animated().glb()).text, "");
}

TEST(GltfBadInput, each_damage_is_refused_with_its_place) {
  for (const Damage& damage : damages()) {
    File file = animated();
    damage.inflict(file);
    const Refusal refusal = refusal_of_bytes(file.glb());
    EXPECT_EQ(refusal.fault, damage.fault) << damage.what << ": " << refusal.text;
    if (damage.text == nullptr) continue;
    EXPECT_EQ(refusal.text, damage.text) << damage.what;
  }
}

TEST(GltfBadInput, a_glb_cut_short_anywhere_is_refused) {
  const TemporaryFolder folder;
  const std::string whole = animated().glb();
  for (std::size_t length = 0; length < whole.size(); ++length) {
    ASSERT_EQ(refusal_of(folder.write("bad.glb", whole.substr(0, length))).fault, 3) << length;
  }
}

TEST(GltfBadInput, the_glb_s_own_lengths_are_checked) {
  const std::string whole = animated().glb();
  const std::string json_length = whole.substr(12, 4);
  const auto with = [&](std::size_t offset, const std::string& bytes) {
    std::string changed = whole;
    return refusal_of_bytes(changed.replace(offset, bytes.size(), bytes)).text;
  };
  EXPECT_EQ(with(4, File::word(1)), "bad.glb: GLB version 1; expected version 2");
  EXPECT_EQ(with(8, File::word(16)),
            "bad.glb@8: GLB header says 16 bytes; the file has " + std::to_string(whole.size()));
  EXPECT_EQ(with(12, File::word(0xFFFFFFFC)), "bad.glb@12: GLB chunk has length 4294967292; " +
                                                  std::to_string(whole.size() - 20) + " bytes are left");
  EXPECT_EQ(with(12, File::word(5)), "bad.glb@12: GLB chunk has length 5; expected a multiple of 4");
  EXPECT_EQ(with(16, "BIN "), "bad.glb@12: the first GLB chunk is not JSON");
}

TEST(GltfBadInput, any_byte_changed_gives_a_result_or_one_line) {
  const TemporaryFolder folder;
  const std::string whole = animated().glb();
  for (std::size_t at = 0; at < whole.size(); ++at) {
    for (const char byte : {'\0', '\xFF', '9'}) {
      std::string changed = whole;
      changed[at] = byte;
      refusal_of(folder.write("bad.glb", changed));
    }
  }
}

TEST(GltfBadInput, json_is_bounded_before_it_is_parsed) {
  const TemporaryFolder folder;
  const std::string deep =
      R"({"asset":{"version":"2.0"},"extras":)" + std::string(100000, '[') + std::string(100000, ']') + "}";
  EXPECT_EQ(refusal_of(folder.write("deep.gltf", deep)).text,
            "deep.gltf@99: JSON is nested deeper than 64 levels");
  std::string wide = R"({"asset":{"version":"2.0"},"extras":[0)";
  for (int i = 0; i < 4000000; ++i) wide += ",0";
  EXPECT_EQ(refusal_of(folder.write("wide.gltf", wide + "]}")).fault, 6);
  const std::string brackets = R"({"asset":{"version":"2.0","x":")" + std::string(100, '[') + R"(\"[["}})";
  EXPECT_EQ(refusal_of(folder.write("text.gltf", brackets)).text, "text.gltf: the scene has no triangles");
}

TEST(GltfBadInput, what_is_not_gltf_is_named_for_what_it_is) {
  const TemporaryFolder folder;
  EXPECT_EQ(refusal_of(folder.write("a.gltf", "")).text, "a.gltf: is empty; expected glTF JSON or GLB");
  EXPECT_EQ(refusal_of(folder.write("a.glb", "version https://git-lfs.github.com/spec/v1\n")).text,
            "a.glb: is a Git LFS pointer; expected glTF JSON or GLB");
  EXPECT_EQ(refusal_of(folder.write("a.glb", "<!DOCTYPE html>")).text,
            "a.glb: looks like HTML or XML; expected glTF JSON or GLB");
  EXPECT_EQ(refusal_of(folder.write("a.gltf", "{\"asset\": nonsense}")).text,
            "a.gltf@12: not JSON from here on");
  EXPECT_EQ(refusal_of(folder.write("a.gltf", "[]")).text, "a.gltf:/: found array, expected an object");
  EXPECT_EQ(refusal_of(folder.write("a.gltf", R"({"asset":{"version":"2.0"},"x":1e999})")).text,
            "a.gltf: JSON has a number too large to read");
  EXPECT_EQ(refusal_of(folder.path() / "gone.gltf").fault, 5);
  EXPECT_EQ(refusal_of(folder.path()).fault, 5);
}

// ---- files beside the file

TEST(GltfBadInput, a_uri_cannot_leave_its_folder) {
  const TemporaryFolder folder;
  const File file = triangle();
  const auto said = [&](const std::string& uri) {
    return refusal_of(folder.write("bad.gltf", file.gltf(uri))).text;
  };
  const std::string place = "bad.gltf:/buffers/0/uri: uri ";
  EXPECT_EQ(said("../../etc/passwd"), place + "'../../etc/passwd' leads out of the asset's folder");
  EXPECT_EQ(said("%2e%2e%2fetc%2Fpasswd"), place + "'%2e%2e%2fetc%2Fpasswd' leads out of the asset's folder");
  EXPECT_EQ(said("a/../b.bin"), place + "'a/../b.bin' leads out of the asset's folder");
  EXPECT_EQ(said("/etc/passwd"),
            place + "'/etc/passwd' is absolute; expected a path below the asset's folder");
  EXPECT_EQ(said("%2Fetc/passwd"),
            place + "'%2Fetc/passwd' is absolute; expected a path below the asset's folder");
  EXPECT_EQ(said("file:///etc/passwd"),
            place + "'file:///etc/passwd' has a scheme; expected a relative path or data:");
  EXPECT_EQ(said("http://a/b"), place + "'http://a/b' has a scheme; expected a relative path or data:");
  EXPECT_EQ(said("C:\\x.bin"), place + "'C:\\x.bin' has a scheme; expected a relative path or data:");
  EXPECT_EQ(said("a%00.bin"), place + "'a%00.bin' has a zero byte");
  EXPECT_EQ(said(""), "bad.gltf:/buffers/0/uri: uri is empty");
  EXPECT_EQ(said("data:;base64,A*"), "bad.gltf:/buffers/0/uri: base64 data has a wrong letter at position 1");
  EXPECT_EQ(said("data:;base64,AAAA"), "bad.gltf:/buffers/0/uri: data uri has 3 bytes; expected 36");
  EXPECT_EQ(said("data:text/plain,hello"), "bad.gltf:/buffers/0/uri: data uri 'text/plain'; expected base64");
}

TEST(GltfBadInput, only_regular_files_below_the_folder_are_opened) {
  const TemporaryFolder outside, folder;
  outside.write("secret.bin", std::string(64, 'x'));
  folder.write("inside.bin", std::string(64, 'x'));
  std::filesystem::create_directory(folder.path() / "sub");
  std::filesystem::create_symlink(outside.path() / "secret.bin", folder.path() / "link.bin");
  std::filesystem::create_directory_symlink(outside.path(), folder.path() / "linked");
  ASSERT_EQ(::mkfifo((folder.path() / "pipe.bin").c_str(), 0600), 0);
  for (const OpenBeneath how : {OpenBeneath::by_kernel, OpenBeneath::by_hand}) {
    const AssetFolder assets(folder.path(), how);
    EXPECT_EQ(assets.read_exactly("inside.bin", 10, "here").size(), 10u);
    EXPECT_EQ(assets.read_up_to("./inside.bin", 64, "here").size(), 64u);
    const auto fault = [&](const std::string& uri, std::uint64_t limit = 1000) {
      try {
        assets.read_up_to(uri, limit, "here");
        return 0;
      } catch (const FileError& error) {
        return static_cast<int>(error.fault());
      }
    };
    EXPECT_EQ(fault("inside.bin", 63), 6);
    EXPECT_EQ(fault("gone.bin"), 3);
    EXPECT_EQ(fault("sub"), 3);
    EXPECT_EQ(fault("pipe.bin"), 3);
    EXPECT_EQ(fault("link.bin"), 3);
    EXPECT_EQ(fault("linked/secret.bin"), 3);
    EXPECT_NE(fault("/proc/self/mem"), 0);
  }
}

TEST(GltfBadInput, a_buffer_file_must_have_the_bytes_it_promises) {
  const TemporaryFolder folder;
  const File file = triangle();
  folder.write("short.bin", file.binary.substr(1));
  folder.write("long.bin", file.binary + "more");
  EXPECT_EQ(refusal_of(folder.write("bad.gltf", file.gltf("short.bin"))).text,
            "bad.gltf:/buffers/0/uri: 'short.bin' has 35 bytes; expected 36");
  EXPECT_EQ(refusal_of(folder.write("good.gltf", file.gltf("long.bin"))).text, "");
  EXPECT_EQ(refusal_of(folder.write("bad.gltf", file.gltf("none.bin"))).text,
            "bad.gltf:/buffers/0/uri: cannot open 'none.bin': No such file or directory");
  ASSERT_EQ(::mkfifo((folder.path() / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(refusal_of(folder.write("bad.gltf", file.gltf("pipe"))).text,
            "bad.gltf:/buffers/0/uri: uri 'pipe' is not a regular file");
  EXPECT_EQ(refusal_of(folder.write("bad.gltf", file.gltf("."))).fault, 3);
}

TEST(GltfBadInput, a_scene_that_repeats_its_meshes_without_end_is_stopped) {
  File file = triangle();
  std::vector<float> many(300000, 0.5f);
  file.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = file.add_floats("VEC3", many);
  Json& scene = file.json["scenes"][0]["nodes"];
  for (int node = 1; node < 600; ++node) {
    file.json["nodes"].push_back({{"mesh", 0}});
    scene.push_back(node);
  }
  EXPECT_EQ(refusal_of_bytes(file.glb()).fault, 6);
}

TEST(GltfBadInput, a_chain_of_many_thousand_nodes_is_no_trouble) {
  File file = ribbon();
  const int first = static_cast<int>(file.json["nodes"].size());
  for (int node = first; node < first + 50000; ++node)
    file.json["nodes"].push_back({{"children", {node + 1}}});
  file.json["nodes"].back().erase("children");
  file.json["nodes"][2]["children"] = {first};
  EXPECT_EQ(refusal_of_bytes(file.glb()).text, "");
}

// ---- what others refuse

TEST(GltfBadInput, shared_bad_files_give_a_result_or_one_line) {
  const std::filesystem::path folder = std::filesystem::path(SINEW_SHARED_DATA) / "bad";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "no shared data at " << folder;
  int seen = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    const Refusal refusal = refusal_of(entry.path());
    const bool gltf = entry.path().extension() == ".gltf" || entry.path().extension() == ".glb";
    const bool sound = entry.path().filename() == "fuzz.glb";
    EXPECT_EQ(refusal.fault == 0, sound) << entry.path() << ": " << refusal.text;
    seen += gltf ? 1 : 0;
  }
  EXPECT_GE(seen, 15);
}

}  // namespace
}  // namespace sinew
