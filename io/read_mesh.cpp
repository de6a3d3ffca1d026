#include "io/atomic_file.h"
#include "io/gltf_reader.h"
#include "io/mesh_asset.h"
#include "io/mesh_reader.h"
#include "io/text_scanner.h"

namespace sinew {

MeshAsset read_mesh(const std::filesystem::path& path) {
  constexpr std::size_t kLargestFile = 4'000'000'000;  // bytes; positions and indices then fit an int
  const std::string extension = path.extension().string();
  if (equal_ignoring_case(extension, ".gltf") || equal_ignoring_case(extension, ".glb")) return GltfFile(path).mesh();
  const std::vector<std::byte> bytes = read_whole_file(path, kLargestFile);
  return parse_mesh({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path);
}

}  // namespace sinew
