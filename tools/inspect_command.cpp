#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>

#include "io/bvh.h"
#include "io/file_error.h"
#include "io/gltf_reader.h"
#include "io/mesh_asset.h"
#include "skeleton/roles.h"
#include "tools/commands.h"

namespace sinew {
namespace {

using Json = nlohmann::ordered_json;

Json describe_mesh(const MeshAsset& asset) {
  const MeshDiagnosis& found = asset.diagnosis;
  const BoundingBox box = bounds(asset.mesh);
  Json json;
  json["vertices"] = found.source_vertices;
  json["faces"] = found.source_faces;
  json["triangles"] = found.triangles;
  json["welded_vertices"] = found.welded_vertices;
  json["unreferenced_vertices"] = found.unreferenced_vertices;
  json["degenerate_triangles"] = found.degenerate_triangles;
  json["duplicate_triangles"] = found.duplicate_triangles;
  json["components"] = found.components;
  json["boundary_edges"] = found.boundary_edges;
  json["non_manifold_edges"] = found.non_manifold_edges;
  json["inconsistent_edges"] = found.inconsistent_edges;
  json["closed"] = found.closed;
  json["outward"] = found.outward;
  json["primitives"] = asset.primitives.size();
  json["low"] = {box.low.x(), box.low.y(), box.low.z()};
  json["high"] = {box.high.x(), box.high.y(), box.high.z()};
  return json;
}

Json describe_skeleton(const Clip& clip) {
  const RoleMap roles = recognise_roles(clip.skeleton);
  Json json;
  json["joints"] = clip.skeleton.joint_count();
  json["frames"] = clip.frame_count;
  json["frames_per_second"] = clip.frames_per_second;
  json["seconds"] = clip.duration();
  json["naming"] = roles.scheme;
  Json found = Json::object();
  for (int role = 0; role < kRoleCount; ++role) {
    const int joint = roles.joint_of_role[role];
    if (joint >= 0) found[std::string(role_name(static_cast<Role>(role)))] = clip.skeleton.names[joint];
  }
  json["roles"] = found;
  return json;
}

Json describe_gltf(const std::filesystem::path& path) {
  const GltfFile file(path);
  Json json;
  json["file"] = path.string();
  json["format"] = path.extension() == ".glb" || path.extension() == ".GLB" ? "glb" : "gltf";
  std::vector<std::string> warnings;
  try {
    const MeshAsset asset = file.mesh();
    json["mesh"] = describe_mesh(asset);
    warnings = asset.warnings;
  } catch (const FileError& error) {
    if (error.fault() != FileFault::unusable) throw;
    warnings.push_back(std::string("W_NO_MESH: ") + error.what());
  }
  json["skins"] = Json::array();
  for (const GltfSkinSummary& skin : file.skins()) {
    json["skins"].push_back({{"name", skin.name}, {"joints", skin.joints}});
  }
  json["animations"] = Json::array();
  for (const GltfAnimationSummary& animation : file.animations()) {
    json["animations"].push_back({{"name", animation.name},
                                  {"seconds", animation.seconds},
                                  {"channels", animation.channels},
                                  {"joints", animation.joints}});
  }
  json["warnings"] = warnings;
  return json;
}

Json describe(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& letter : extension) letter = static_cast<char>(std::tolower(static_cast<unsigned char>(letter)));
  if (extension == ".gltf" || extension == ".glb") return describe_gltf(path);
  Json json;
  json["file"] = path.string();
  if (extension == ".bvh") {
    const Clip clip = read_bvh(path);
    json["format"] = "bvh";
    json["motion"] = describe_skeleton(clip);
    json["warnings"] = clip.warnings;
    return json;
  }
  const MeshAsset asset = read_mesh(path);
  json["format"] = asset.format;
  json["mesh"] = describe_mesh(asset);
  json["warnings"] = asset.warnings;
  return json;
}

std::string as_cell(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_boolean()) return value.get<bool>() ? "yes" : "no";
  return value.dump();
}

/// Labels left, values in one column; nested objects indented beneath their name.
void print_table(std::ostream& out, const Json& json, const std::string& indent) {
  constexpr int kLabelWidth = 26;
  for (const auto& [key, value] : json.items()) {
    std::string label = key;
    for (char& letter : label) letter = letter == '_' ? ' ' : letter;
    if (value.is_object()) {
      out << indent << label << '\n';
      print_table(out, value, indent + "  ");
    } else if (value.is_array() && !value.empty() && !value.front().is_number()) {
      out << indent << label << '\n';
      for (const Json& entry : value) {
        if (entry.is_object()) {
          std::string line;
          for (const auto& [name, field] : entry.items()) line += (line.empty() ? "" : ", ") + name + ' ' + as_cell(field);
          out << indent << "  " << line << '\n';
        } else {
          out << indent << "  " << as_cell(entry) << '\n';
        }
      }
    } else if (!value.is_array() || !value.empty()) {
      out << indent << std::left << std::setw(kLabelWidth - static_cast<int>(indent.size())) << label << as_cell(value)
          << '\n';
    }
  }
}

}  // namespace

ExitCode run_inspect(const InspectOptions& options) {
  const Json json = describe(options.file);
  if (options.json) {
    std::cout << json.dump(2) << '\n';
  } else {
    print_table(std::cout, json, "");
  }
  std::cout.flush();
  if (!std::cout) throw FileError(FileFault::input_output, "standard output", "cannot write");
  return ExitCode::ok;
}

}  // namespace sinew
