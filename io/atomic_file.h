#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

namespace sinew {

/// A file that appears whole or not at all: written beside its final name, synced, then renamed.
/// Destroyed before commit(), it leaves nothing behind. Throws FileError (input_output).
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  void write(std::span<const std::byte> bytes);
  void write(std::string_view text);
  void commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path temporary_;
  int descriptor_ = -1;
};

/// Whole file in memory; refuses directories, devices and files over `limit` bytes before reading.
std::vector<std::byte> read_whole_file(const std::filesystem::path& path, std::size_t limit);

}  // namespace sinew
