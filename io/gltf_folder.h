#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace sinew {

/// True when the uri carries its bytes itself ("data:...;base64,...").
bool is_data_uri(std::string_view uri);

struct DataUri {
  std::string mime_type;  ///< what stands before the first ';', may be empty
  std::vector<std::byte> bytes;
};
/// Decodes a base64 data uri. Throws FileError (malformed) at `where`.
DataUri decode_data_uri(std::string_view uri, const std::string& where);

/// The path, relative to the asset's folder, that a uri means: percent escapes decoded. Throws
/// FileError (malformed) at `where` for what could lead elsewhere: a scheme, an absolute path, a ".."
/// part, a NUL.
std::string relative_path_of_uri(std::string_view uri, const std::string& where);

/// How files below the asset's folder are opened. The kernel's own confinement is the default; the
/// walk by hand stands in where the kernel or a sandbox does not know openat2, and follows no
/// symbolic link at all.
enum class OpenBeneath { by_kernel, by_hand };

/// The folder a glTF file lies in. Opens regular files below it, and nothing else.
class AssetFolder {
 public:
  explicit AssetFolder(const std::filesystem::path& folder, OpenBeneath how = OpenBeneath::by_kernel);
  ~AssetFolder();
  AssetFolder(const AssetFolder&) = delete;
  AssetFolder& operator=(const AssetFolder&) = delete;

  /// The first `bytes` bytes of the file a uri names; a shorter file is malformed.
  std::vector<std::byte> read_exactly(std::string_view uri, std::uint64_t bytes,
                                      const std::string& where) const;
  /// The whole file a uri names; one over `limit` bytes is a resource fault.
  std::vector<std::byte> read_up_to(std::string_view uri, std::uint64_t limit,
                                    const std::string& where) const;

 private:
  int open_file(const std::string& path, std::uint64_t& size, const std::string& where) const;

  OpenBeneath how_;
  int folder_ = -1;
};

}  // namespace sinew
