#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/rig.h"

namespace sinew {

/// A body with its joints, to build systems of any size from.
struct Scene {
  std::string name;
  TriMesh mesh;
  RigSkeleton skeleton;
};

/// Where the named meshes are looked for.
struct SceneFolders {
  std::filesystem::path data;     ///< the folder with meshes/ and large/
  std::filesystem::path samples;  ///< the project's samples: ogre/ogre.obj, ogre/ogre.toml, rigs/NAME.toml
};

/// The samples of the source this was built from.
std::filesystem::path built_in_samples();

/// "ogre", which comes with the project, and the meshes that are read from the data folder.
std::vector<std::string> scene_names();

/// Whether the named scene can be had; its file is there.
bool scene_exists(const std::string& name, const SceneFolders& folders);

/// Throws UnusableInput when a file is not there, saying which option helps; FileError from reading.
Scene load_scene(const std::string& name, const SceneFolders& folders);

/// A rig of `scene` with about `free_nodes` free nodes, within 10 %, by choosing the
/// spacing of the lattice. Throws UnusableInput when the surface alone has more, or no spacing gives that
/// many.
Rig build_rig_of_size(const Scene& scene, int free_nodes, Deform deform, ThreadTeam& team,
                      SubspaceOf subspace = SubspaceOf::nothing);

}  // namespace sinew
