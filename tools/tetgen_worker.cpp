// sinew-tetgen: fills a surface, read from standard input, with tetrahedra, written to standard output.
//
// The only file that includes tetgen.h. TetGen [Si 2015] reports failure by throwing an int, and worse:
// on damaged surfaces it has been seen to crash and to run without end. So this is a program of its
// own, started by sinew under limits of time and memory, and sinew survives its death. TetGen's licence
// is the AGPL, which covers this program where it is distributed and does not reach across to sinew.

#include <tetgen.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <iostream>
#include <iterator>
#include <new>
#include <string>
#include <string_view>
#include <vector>

#include "pipeline/tetgen_protocol.h"

namespace {

using namespace sinew::tetgen_protocol;

/// TetGen's own code for input it cannot use.
constexpr int kInputError = 10;

std::string_view reason(int code) {
  switch (code) {
    case 1:
      return "out of memory";
    case 2:
      return "internal error of TetGen";
    case 3:
      return "the surface intersects itself";
    case 4:
      return "the surface has a feature too small for TetGen";
    case 5:
      return "two faces of the surface are too close to each other";
    case kInputError:
      return "TetGen cannot use this surface";
    case 200:
      return "TetGen would have to add points on the surface";
    default:
      return "TetGen failed";
  }
}

/// TetGen prints to standard output, where the answer goes. Returns where to write it instead.
std::FILE* keep_output_for_the_answer() {
  std::FILE* answer = fdopen(dup(STDOUT_FILENO), "wb");
  dup2(STDERR_FILENO, STDOUT_FILENO);
  return answer;
}

/// A surface as read, whose arrays are copied into TetGen's own. Returns the largest volume wanted.
double read_surface(std::string_view bytes, tetgenio& surface) {
  const auto require = [](bool condition) {
    if (!condition) throw kInputError;
  };
  require(bytes.size() >= kSurfaceMagic.size() + sizeof(SurfaceHeader) + sizeof(std::uint64_t));
  require(bytes.starts_with(kSurfaceMagic));
  const std::string_view covered = bytes.substr(0, bytes.size() - sizeof(std::uint64_t));
  bytes.remove_prefix(kSurfaceMagic.size());
  SurfaceHeader header;
  take(bytes, &header, 1);
  constexpr std::uint64_t kMany = std::uint64_t{1} << 31;  // TetGen counts in int
  require(header.vertex_count < kMany && header.triangle_count < kMany);
  const std::uint64_t payload =
      header.vertex_count * 3 * sizeof(double) + header.triangle_count * 3 * sizeof(std::int32_t);
  require(payload == bytes.size() - sizeof(std::uint64_t));

  surface.numberofpoints = static_cast<int>(header.vertex_count);
  surface.pointlist = new REAL[header.vertex_count * 3];
  take(bytes, surface.pointlist, header.vertex_count * 3);
  surface.numberoffacets = static_cast<int>(header.triangle_count);
  surface.facetlist = new tetgenio::facet[header.triangle_count];
  for (std::uint64_t k = 0; k < header.triangle_count; ++k) {
    tetgenio::facet& facet = surface.facetlist[k];
    tetgenio::init(&facet);
    facet.numberofpolygons = 1;
    facet.polygonlist = new tetgenio::polygon[1];
    tetgenio::polygon& triangle = facet.polygonlist[0];
    tetgenio::init(&triangle);
    triangle.numberofvertices = 3;
    triangle.vertexlist = new int[3];
    take(bytes, triangle.vertexlist, 3);
  }
  std::uint64_t sum = 0;
  take(bytes, &sum, 1);
  require(sum == checksum(covered));
  return header.largest_volume;
}

std::string tetrahedra_message(const tetgenio& filled) {
  static_assert(sizeof(REAL) == sizeof(double) && sizeof(int) == sizeof(std::int32_t));
  const TetrahedraHeader header{static_cast<std::uint64_t>(filled.numberofpoints),
                                static_cast<std::uint64_t>(filled.numberoftetrahedra)};
  std::string bytes(kTetrahedraMagic);
  append(bytes, &header, 1);
  append(bytes, filled.pointlist, header.node_count * 3);
  append(bytes, filled.tetrahedronlist, header.tetrahedron_count * 4);
  append_checksum(bytes);
  return bytes;
}

}  // namespace

int main() try {
  std::FILE* answer = keep_output_for_the_answer();
  const std::string message((std::istreambuf_iterator<char>(std::cin)), std::istreambuf_iterator<char>());
  tetgenio surface, filled;  // TetGen frees what they hold when they go out of scope
  const double largest_volume = read_surface(message, surface);

  // Tetrahedra (p) of good shape (q) and limited volume (a); the surface stays as it is (Y); quiet (Q).
  std::array<char, 64> switches = {};
  std::snprintf(switches.data(), switches.size(), "pYq1.4a%.17fQ", largest_volume);
  tetrahedralize(switches.data(), &surface, &filled);

  const std::string bytes = tetrahedra_message(filled);
  const bool written = std::fwrite(bytes.data(), 1, bytes.size(), answer) == bytes.size();
  return written && std::fclose(answer) == 0 ? 0 : 1;
} catch (int code) {
  std::cerr << reason(code) << '\n';
  return code;
} catch (const std::bad_alloc&) {
  std::cerr << reason(1) << '\n';
  return 1;
}
