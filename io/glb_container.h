#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace sinew {

/// The binary chunk of a GLB, gathered in pieces so that nothing large is copied twice. Every piece
/// starts at a multiple of four bytes, which aligns all component types glTF has.
class GlbBinary {
 public:
  /// Takes the piece over and returns the offset of its first byte in the chunk.
  std::int64_t append(std::vector<std::byte> piece);
  std::int64_t size() const { return size_; }
  const std::vector<std::vector<std::byte>>& pieces() const { return pieces_; }

 private:
  std::vector<std::vector<std::byte>> pieces_;
  std::int64_t size_ = 0;
};

/// A GLB's two length fields have 32 bits; larger files cannot be expressed.
constexpr std::int64_t kLargestGlb = 0xffff'fff0;

/// Writes header, JSON chunk and binary chunk, whole or not at all; returns the file's size.
/// Throws FileError: resource above kLargestGlb, input_output when writing fails.
std::int64_t write_glb(const std::filesystem::path& path, std::string json, const GlbBinary& binary);

}  // namespace sinew
