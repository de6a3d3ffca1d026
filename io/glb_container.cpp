// GLB: glTF 2.0 specification, section 4 (binary container), all numbers little endian.
#include "io/glb_container.h"

#include <array>
#include <bit>
#include <span>

#include "io/atomic_file.h"
#include "io/file_error.h"

namespace sinew {
namespace {

static_assert(std::endian::native == std::endian::little, "buffers are written as they lie in memory");

constexpr std::uint32_t kMagic = 0x46546c67;        // "glTF"
constexpr std::uint32_t kJsonChunk = 0x4e4f534a;    // "JSON"
constexpr std::uint32_t kBinaryChunk = 0x004e4942;  // "BIN"

std::size_t padding_of(std::size_t size) {
  return (4 - size % 4) % 4;
}

template <std::size_t count>
void write_words(AtomicFile& file, const std::array<std::uint32_t, count>& words) {
  file.write(std::as_bytes(std::span(words)));
}

}  // namespace

std::int64_t GlbBinary::append(std::vector<std::byte> piece) {
  const std::int64_t offset = size_;
  piece.resize(piece.size() + padding_of(piece.size()), std::byte{0});
  size_ += static_cast<std::int64_t>(piece.size());
  pieces_.push_back(std::move(piece));
  return offset;
}

std::int64_t write_glb(const std::filesystem::path& path, std::string json, const GlbBinary& binary) {
  json.append(padding_of(json.size()), ' ');
  const bool has_binary = binary.size() > 0;
  const std::int64_t total =
      12 + 8 + static_cast<std::int64_t>(json.size()) + (has_binary ? 8 + binary.size() : 0);
  if (total > kLargestGlb) {
    throw FileError(
        FileFault::resource, path.string(),
        "a GLB of " + std::to_string(total) + " bytes; the format ends at " + std::to_string(kLargestGlb));
  }
  AtomicFile file(path);
  write_words<3>(file, {kMagic, 2, static_cast<std::uint32_t>(total)});
  write_words<2>(file, {static_cast<std::uint32_t>(json.size()), kJsonChunk});
  file.write(json);
  if (has_binary) {
    write_words<2>(file, {static_cast<std::uint32_t>(binary.size()), kBinaryChunk});
    for (const auto& piece : binary.pieces()) file.write(std::span<const std::byte>(piece));
  }
  file.commit();
  return total;
}

}  // namespace sinew
