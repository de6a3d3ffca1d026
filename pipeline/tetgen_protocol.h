#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

/// What sinew and its worker program sinew-tetgen say to each other, in the byte order of the machine
/// both run on.
///
/// Surface, to the worker:    magic, header, vertices (3 doubles each), triangles (3 int32 each), checksum
/// Tetrahedra, from it:       magic, header, nodes (3 doubles each), tetrahedra (4 int32 each), checksum
///
/// The first nodes are the vertices, unchanged and in their order. Tetrahedra are positively oriented: the
/// last corner lies on the side from which the first three are counter-clockwise seen from behind, that
/// is (b - a) x (c - a) . (d - a) > 0. The checksum is over all bytes before it.
namespace sinew::tetgen_protocol {

constexpr std::string_view kSurfaceMagic = "SNWSURF1";
constexpr std::string_view kTetrahedraMagic = "SNWTETS1";

struct SurfaceHeader {
  std::uint64_t vertex_count = 0;
  std::uint64_t triangle_count = 0;
  double largest_volume = 0.0;  ///< of a tetrahedron
};

struct TetrahedraHeader {
  std::uint64_t node_count = 0;
  std::uint64_t tetrahedron_count = 0;
};

/// FNV-1a, 64 bits.
inline std::uint64_t checksum(std::string_view bytes) {
  std::uint64_t hash = 14695981039346656037u;
  for (const char byte : bytes) hash = (hash ^ static_cast<unsigned char>(byte)) * 1099511628211u;
  return hash;
}

template <typename T>
void append(std::string& bytes, const T* values, std::size_t count) {
  bytes.append(reinterpret_cast<const char*>(values), count * sizeof(T));
}

inline void append_checksum(std::string& bytes) {
  const std::uint64_t sum = checksum(bytes);
  append(bytes, &sum, 1);
}

/// Takes `count` values off the front of `bytes`, which must hold them.
template <typename T>
void take(std::string_view& bytes, T* values, std::size_t count) {
  if (count > 0) std::memcpy(values, bytes.data(), count * sizeof(T));
  bytes.remove_prefix(count * sizeof(T));
}

}  // namespace sinew::tetgen_protocol
