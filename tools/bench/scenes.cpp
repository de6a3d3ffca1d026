#include "tools/bench/scenes.h"

#include <algorithm>
#include <cmath>

#include "io/mesh_asset.h"
#include "io/rig_file.h"
#include "pipeline/free_system.h"
#include "pipeline/solid.h"
#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

struct SceneFile {
  const char* name;
  bool sample;  ///< comes with the project: in the samples folder, not in the data folder
  const char* mesh;
  const char* rig;  ///< in the samples folder
};

constexpr SceneFile kFiles[] = {
    {"ogre", true, "ogre/ogre.obj", "ogre/ogre.toml"},
    {"armadillo", false, "meshes/libigl/armadillo.obj", "rigs/armadillo.toml"},
    {"armadillo_loop2", false, "large/derived/armadillo_loop2.ply", "rigs/armadillo.toml"},
    {"human_man", false, "meshes/odedstein/human_man.obj", "rigs/human_man.toml"},
    {"camel", false, "meshes/sumner-popovic/camel_ref.obj", "rigs/camel_ref.toml"},
    {"koala", false, "meshes/odedstein/koala.obj", "rigs/koala.toml"},
};

const SceneFile* find_file(const std::string& name) {
  const auto* found = std::find_if(std::begin(kFiles), std::end(kFiles),
                                   [&](const SceneFile& file) { return name == file.name; });
  return found == std::end(kFiles) ? nullptr : found;
}

std::filesystem::path mesh_path(const SceneFile& file, const SceneFolders& folders) {
  return (file.sample ? folders.samples : folders.data) / file.mesh;
}

/// How many nodes a spacing leaves free, without the fields and the solver that a rig has besides.
int count_free(const Scene& scene, const Solid& solid, const RigOptions& options, ThreadTeam& team) {
  VolumeGraph volume = build_volume_graph(scene.mesh, solid, options.volume, team);
  const Binding binding = bind(scene.mesh, solid, scene.skeleton, options.binding, volume);
  return volume.node_count() -
         static_cast<int>(binding.spheres.size() + binding.cores.size() + binding.glued.size());
}

/// Nodes of a body-centred-cubic lattice go with the cube of its spacing, less a layer at the surface that
/// goes with the square: two probes tell both.
class SpacingSearch {
 public:
  SpacingSearch(const Scene& scene, int wanted, RigOptions& options, ThreadTeam& team)
      : scene_(scene), solid_(scene.mesh), wanted_(wanted), options_(options), team_(team) {}

  /// Leaves the spacing found in the options. False when none gives as many.
  bool run() {
    constexpr int kProbes = 6;
    constexpr double kNear = 0.04;  // what is left of the 10 % is for the reader
    const double inside = wanted_ - scene_.mesh.vertex_count();
    const double volume = std::abs(enclosed_volume(scene_.mesh, scene_.mesh.positions));
    double spacing = std::cbrt(2.0 * volume / inside);
    for (int probe = 0; probe < kProbes; ++probe) {
      options_.volume.spacing = spacing;
      const int found = count_free(scene_, solid_, options_, team_);
      const double error = static_cast<double>(found) / wanted_ - 1.0;
      if (std::abs(error) <= kNear) return true;
      const double now = std::max(1.0, static_cast<double>(found - scene_.mesh.vertex_count()));
      spacing *= std::clamp(std::cbrt(now / inside), 0.5, 2.0);
    }
    return false;
  }

 private:
  const Scene& scene_;
  Solid solid_;
  int wanted_;
  RigOptions& options_;
  ThreadTeam& team_;
};

}  // namespace

std::filesystem::path built_in_samples() {
  return SINEW_SAMPLES_DIR;
}

std::vector<std::string> scene_names() {
  std::vector<std::string> names;
  for (const SceneFile& file : kFiles) names.push_back(file.name);
  return names;
}

bool scene_exists(const std::string& name, const SceneFolders& folders) {
  const SceneFile* file = find_file(name);
  return file != nullptr && std::filesystem::exists(mesh_path(*file, folders));
}

Scene load_scene(const std::string& name, const SceneFolders& folders) {
  const SceneFile* file = find_file(name);
  if (file == nullptr) throw UnusableInput("there is no mesh '" + name + "'");
  const std::filesystem::path mesh = mesh_path(*file, folders);
  if (!std::filesystem::exists(mesh)) {
    throw UnusableInput(name + ": there is no " + mesh.string() + "; " +
                        (file->sample ? "--samples" : "--data") + " says where it is");
  }
  return {name, read_mesh(mesh).mesh, read_rig(folders.samples / file->rig)};
}

Rig build_rig_of_size(const Scene& scene, int free_nodes, Deform deform, ThreadTeam& team,
                      SubspaceOf subspace) {
  const auto refuse = [&](const std::string& why) {
    return UnusableInput(scene.name + " with " + std::to_string(free_nodes) + " free nodes: " + why);
  };
  if (scene.mesh.vertex_count() >= free_nodes) {
    throw refuse("its surface alone has " + std::to_string(scene.mesh.vertex_count()));
  }
  RigOptions options;
  options.binding = binding_options(deform);
  if (!SpacingSearch(scene, free_nodes, options, team).run()) throw refuse("no lattice gives that many");
  options.subspace = subspace;
  return build_rig(scene.mesh, scene.skeleton, options, team);
}

}  // namespace sinew
