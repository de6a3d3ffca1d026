// The GLB layout follows the glTF 2.0 specification, section 4.4 (binary glTF layout).
#include "io/gltf_container.h"

#include <cstdint>
#include <utility>

#include "io/atomic_file.h"
#include "io/file_error.h"

namespace sinew {
namespace {

constexpr std::size_t kLargestFile = std::size_t{1} << 30;
constexpr int kDeepestJson = 64;
constexpr std::int64_t kMostJsonValues = 4'000'000;

constexpr std::uint32_t kMagic = 0x46546C67;      // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4E4F534A;  // "JSON"
constexpr std::uint32_t kBinChunk = 0x004E4942;   // "BIN\0"
constexpr std::size_t kHeaderSize = 12;
constexpr std::size_t kChunkHeaderSize = 8;

[[noreturn]] void refuse(const std::filesystem::path& path, std::size_t byte, const std::string& what) {
  throw FileError(FileFault::malformed, path.string() + "@" + std::to_string(byte), what);
}

/// Little endian; the caller has checked that four bytes are there.
std::uint32_t word_at(std::span<const std::byte> bytes, std::size_t offset) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4; ++i) word |= std::to_integer<std::uint32_t>(bytes[offset + i]) << (8 * i);
  return word;
}

struct Chunk {
  std::uint32_t type = 0;
  std::size_t offset = 0;  ///< of its data
  std::size_t size = 0;
};

Chunk chunk_at(std::span<const std::byte> bytes, std::size_t offset, const std::filesystem::path& path) {
  if (bytes.size() - offset < kChunkHeaderSize) refuse(path, offset, "GLB chunk header is cut short");
  const Chunk chunk{word_at(bytes, offset + 4), offset + kChunkHeaderSize, word_at(bytes, offset)};
  const std::size_t left = bytes.size() - chunk.offset;
  if (chunk.size > left) {
    refuse(path, offset,
           "GLB chunk has length " + std::to_string(chunk.size) + "; " + std::to_string(left) +
               " bytes are left");
  }
  if (chunk.size % 4 != 0) {
    refuse(path, offset, "GLB chunk has length " + std::to_string(chunk.size) + "; expected a multiple of 4");
  }
  return chunk;
}

void check_header(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  if (bytes.size() < kHeaderSize) refuse(path, bytes.size(), "GLB header is cut short; expected 12 bytes");
  const std::uint32_t version = word_at(bytes, 4);
  if (version != 2) {
    throw FileError(FileFault::unusable, path.string(),
                    "GLB version " + std::to_string(version) + "; expected version 2");
  }
  const std::uint32_t length = word_at(bytes, 8);
  if (length != bytes.size()) {
    refuse(
        path, 8,
        "GLB header says " + std::to_string(length) + " bytes; the file has " + std::to_string(bytes.size()));
  }
}

void find_chunks(GltfContainer& container, const std::filesystem::path& path) {
  const std::span<const std::byte> bytes = container.bytes;
  check_header(bytes, path);
  const Chunk json = chunk_at(bytes, kHeaderSize, path);
  if (json.type != kJsonChunk) refuse(path, kHeaderSize, "the first GLB chunk is not JSON");
  container.json_offset = json.offset;
  container.json_size = json.size;
  // Chunks of unknown type may follow the binary one; they are walked over so that their lengths are checked.
  bool second = true;
  for (std::size_t next = json.offset + json.size; next < bytes.size(); second = false) {
    const Chunk chunk = chunk_at(bytes, next, path);
    if (chunk.type == kBinChunk) {
      if (!second) refuse(path, next, "a BIN chunk that is not the second chunk");
      container.has_binary = true;
      container.binary_offset = chunk.offset;
      container.binary_size = chunk.size;
    }
    next = chunk.offset + chunk.size;
  }
}

/// What people hand us instead of a model, said in their words.
void explain_wrong_file(std::string_view text, const std::filesystem::path& path) {
  const std::size_t start = text.find_first_not_of(" \t\r\n");
  if (start == std::string_view::npos) {
    throw FileError(FileFault::malformed, path.string(), "is empty; expected glTF JSON or GLB");
  }
  text.remove_prefix(start);
  if (text.starts_with("version https://git-lfs")) {
    throw FileError(FileFault::malformed, path.string(), "is a Git LFS pointer; expected glTF JSON or GLB");
  }
  if (text.starts_with("<")) {
    throw FileError(FileFault::malformed, path.string(), "looks like HTML or XML; expected glTF JSON or GLB");
  }
}

}  // namespace

GltfContainer parse_gltf_container(std::vector<std::byte> bytes, const std::filesystem::path& path) {
  GltfContainer container;
  container.bytes = std::move(bytes);
  container.is_glb = container.bytes.size() >= 4 && word_at(container.bytes, 0) == kMagic;
  if (container.is_glb) {
    find_chunks(container, path);
  } else {
    container.json_size = container.bytes.size();
    explain_wrong_file(container.json(), path);
  }
  check_json_bounds(container.json(), path.string());
  return container;
}

GltfContainer read_gltf_container(const std::filesystem::path& path) {
  return parse_gltf_container(read_whole_file(path, kLargestFile), path);
}

void check_json_bounds(std::string_view json, const std::string& where) {
  int depth = 0;
  std::int64_t values = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < json.size(); ++i) {
    const char letter = json[i];
    if (in_string) {
      if (letter == '\\') ++i;
      in_string = letter != '"';
      continue;
    }
    in_string = letter == '"';
    if (letter == '[' || letter == '{') ++depth;
    if (letter == ']' || letter == '}') --depth;
    if (letter == ',' || letter == '[' || letter == '{') ++values;
    if (depth > kDeepestJson) {
      throw FileError(FileFault::malformed, where + "@" + std::to_string(i),
                      "JSON is nested deeper than " + std::to_string(kDeepestJson) + " levels");
    }
    if (values > kMostJsonValues) {
      throw FileError(FileFault::resource, where + "@" + std::to_string(i),
                      "JSON has more than " + std::to_string(kMostJsonValues) + " values");
    }
  }
}

}  // namespace sinew
