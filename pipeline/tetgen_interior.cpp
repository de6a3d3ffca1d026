#include "pipeline/tetgen_interior.h"

#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>
#include <string_view>

#include "pipeline/tetgen_protocol.h"
#include "pipeline/worker_process.h"

namespace sinew {
namespace {

using namespace tetgen_protocol;
using Eigen::Vector3d;
using Tetrahedron = std::array<std::int32_t, 4>;

constexpr const char* kWorkerName = "sinew-tetgen";

/// Largest tetrahedron, in cubes of the spacing, at which TetGen's quality meshes have the two nodes a
/// cube of the lattice. Measured on a sphere and on human bodies.
constexpr double kLargestVolume = 0.14;

/// Share by which the volume of all tetrahedra may differ from that inside the surface.
constexpr double kVolumeTolerance = 1e-3;

/// TetGen's exact tests accept slivers whose volume rounds to nothing or below. In cubes of the
/// longest edge.
constexpr double kSliver = 1e-12;

bool is_program(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::is_regular_file(path, ignored) && access(path.c_str(), X_OK) == 0;
}

/// The worker asked for, or the one beside this program, or the first on the PATH.
std::string find_worker(const VolumeGraphOptions& options) {
  if (!options.tetgen_worker.empty()) {
    if (is_program(options.tetgen_worker)) return options.tetgen_worker;
    throw TetgenFailure("is not a program that can be run: " + options.tetgen_worker);
  }
  std::error_code ignored;
  const std::filesystem::path self = std::filesystem::read_symlink("/proc/self/exe", ignored);
  if (is_program(self.parent_path() / kWorkerName)) return self.parent_path() / kWorkerName;
  const char* path = std::getenv("PATH");
  std::string_view folders = path != nullptr ? path : "";
  while (!folders.empty()) {
    const std::string_view folder = folders.substr(0, folders.find(':'));
    folders.remove_prefix(std::min(folder.size() + 1, folders.size()));
    const std::filesystem::path candidate = std::filesystem::path(folder) / kWorkerName;
    if (candidate.is_absolute() && is_program(candidate)) return candidate;
  }
  throw TetgenFailure(std::string(kWorkerName) +
                      " was not found, neither beside this program nor on the PATH");
}

/// Vertices in the box from -1 to 1: TetGen's tolerances then do not depend on where and how large the
/// mesh is.
struct UnitBox {
  Vector3d middle;
  double half_size = 1.0;

  explicit UnitBox(const BoundingBox& box)
      : middle((box.low + box.high) / 2.0), half_size((box.high - box.low).maxCoeff() / 2.0) {}
  Field3 to_unit(const Field3& positions) const {
    return (positions.rowwise() - middle.transpose()) / half_size;
  }
  Field3 from_unit(const Field3& positions) const {
    return (positions * half_size).rowwise() + middle.transpose();
  }
};

std::string surface_message(const TriMesh& mesh, double largest_volume) {
  const SurfaceHeader header{static_cast<std::uint64_t>(mesh.vertex_count()), mesh.triangles.size(),
                             largest_volume};
  std::string bytes(kSurfaceMagic);
  append(bytes, &header, 1);
  append(bytes, mesh.positions.data(), static_cast<std::size_t>(mesh.positions.size()));
  append(bytes, mesh.triangles.data(), mesh.triangles.size());
  append_checksum(bytes);
  return bytes;
}

struct Tetrahedra {
  Field3 nodes;
  std::vector<Tetrahedron> corners;
};

void require(bool condition, const std::string& otherwise) {
  if (!condition) throw TetgenFailure("answered nonsense: " + otherwise);
}

/// Sizes before contents: nothing is allocated that the message does not really hold.
Tetrahedra parse_tetrahedra(std::string_view bytes, int max_nodes) {
  constexpr std::size_t kFrame = kTetrahedraMagic.size() + sizeof(TetrahedraHeader) + sizeof(std::uint64_t);
  require(bytes.size() >= kFrame && bytes.starts_with(kTetrahedraMagic), "not tetrahedra");
  const std::string_view covered = bytes.substr(0, bytes.size() - sizeof(std::uint64_t));
  bytes.remove_prefix(kTetrahedraMagic.size());
  TetrahedraHeader header;
  take(bytes, &header, 1);
  const std::uint64_t payload = bytes.size() - sizeof(std::uint64_t);
  require(header.node_count <= static_cast<std::uint64_t>(max_nodes),
          std::to_string(header.node_count) + " nodes, more than the limit of " + std::to_string(max_nodes));
  const std::uint64_t node_bytes = header.node_count * 3 * sizeof(double);
  require(node_bytes <= payload && header.tetrahedron_count <= payload / sizeof(Tetrahedron) &&
              node_bytes + header.tetrahedron_count * sizeof(Tetrahedron) == payload,
          "the sizes do not match");
  Tetrahedra tetrahedra;
  tetrahedra.nodes.resize(static_cast<Eigen::Index>(header.node_count), 3);
  take(bytes, tetrahedra.nodes.data(), header.node_count * 3);
  tetrahedra.corners.resize(header.tetrahedron_count);
  take(bytes, tetrahedra.corners.data(), header.tetrahedron_count);
  std::uint64_t sum = 0;
  take(bytes, &sum, 1);
  require(sum == checksum(covered), "the checksum does not match");
  return tetrahedra;
}

double checked_volume(const Tetrahedra& tetrahedra, const Tetrahedron& corners) {
  std::array<Vector3d, 4> at;
  for (int k = 0; k < 4; ++k) at[k] = tetrahedra.nodes.row(corners[k]);
  const double volume = (at[1] - at[0]).cross(at[2] - at[0]).dot(at[3] - at[0]) / 6.0;
  double longest = 0.0;
  for (int a = 0; a < 4; ++a) {
    for (int b = 0; b < a; ++b) longest = std::max(longest, (at[a] - at[b]).norm());
  }
  require(volume > -kSliver * longest * longest * longest, "a tetrahedron is turned inside out");
  return volume;
}

/// Whether this is a filling of `surface`: its vertices first, then nodes that all belong to
/// tetrahedra, which together have its volume.
void check_filling(const TriMesh& surface, const Tetrahedra& tetrahedra) {
  const Eigen::Index vertex_count = surface.positions.rows();
  const auto node_count = static_cast<std::int32_t>(tetrahedra.nodes.rows());
  require(node_count >= vertex_count && tetrahedra.nodes.topRows(vertex_count) == surface.positions,
          "the surface is not the one that was sent");
  require(tetrahedra.nodes.allFinite(), "a coordinate is not a finite number");
  std::vector<char> used(node_count, 0);
  double volume = 0.0;
  for (const Tetrahedron& corners : tetrahedra.corners) {
    for (const std::int32_t node : corners) {
      require(node >= 0 && node < node_count, "a tetrahedron names a node that is not there");
      used[node] = 1;
    }
    volume += checked_volume(tetrahedra, corners);
  }
  require(std::find(used.begin() + vertex_count, used.end(), 0) == used.end(),
          "a node without a tetrahedron");
  const double enclosed =
      std::abs(enclosed_volume(surface, surface.positions));  // whichever way it is turned
  require(
      std::abs(volume - enclosed) <= kVolumeTolerance * enclosed,
      "the tetrahedra have " + std::to_string(volume / enclosed) + " times the volume inside the surface");
}

std::vector<Edge> tetrahedra_edges(const std::vector<Tetrahedron>& tetrahedra) {
  std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
  pairs.reserve(6 * tetrahedra.size());
  for (const Tetrahedron& corners : tetrahedra) {
    for (int a = 0; a < 4; ++a) {
      for (int b = 0; b < a; ++b) pairs.push_back(std::minmax(corners[a], corners[b]));
    }
  }
  std::sort(pairs.begin(), pairs.end());
  pairs.erase(std::unique(pairs.begin(), pairs.end()), pairs.end());
  std::vector<Edge> edges;
  edges.reserve(pairs.size());
  for (const auto& [a, b] : pairs) {
    require(a != b, "a tetrahedron names a node twice");
    edges.push_back({a, b, 1.0});
  }
  return edges;
}

}  // namespace

InteriorNodes fill_with_tetrahedra(const TriMesh& mesh, const Solid& solid, double spacing,
                                   const VolumeGraphOptions& options) {
  if (!solid.closed()) throw TetgenFailure("was not asked: the surface is not closed");
  const std::string worker = find_worker(options);
  const UnitBox box(bounds(mesh));
  const TriMesh unit{box.to_unit(mesh.positions), mesh.triangles};
  const double unit_spacing = spacing / box.half_size;
  const std::string message = surface_message(unit, kLargestVolume * std::pow(unit_spacing, 3));
  const WorkerResult result = run_worker(worker, message, {options.worker_seconds, options.worker_megabytes});
  if (!result.failure.empty()) throw TetgenFailure(result.failure);

  const int max_nodes = static_cast<int>(std::min<std::int64_t>(
      std::int64_t{options.max_nodes} + mesh.vertex_count(), std::numeric_limits<int>::max()));
  const Tetrahedra tetrahedra = parse_tetrahedra(result.output, max_nodes);
  check_filling(unit, tetrahedra);
  const Eigen::Index interior_count = tetrahedra.nodes.rows() - mesh.vertex_count();
  return {box.from_unit(tetrahedra.nodes.bottomRows(interior_count)), tetrahedra_edges(tetrahedra.corners)};
}

}  // namespace sinew
