// Uris after RFC 3986; openat2 after its manual page (Linux 5.6).
#include "io/gltf_folder.h"

#include <fcntl.h>
#include <linux/openat2.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cerrno>
#include <cstring>

#include "io/file_error.h"

namespace sinew {
namespace {

[[noreturn]] void refuse(const std::string& where, const std::string& what) {
  throw FileError(FileFault::malformed, where, what);
}

/// For messages: a uri as one short printable line.
std::string shown(std::string_view text) {
  constexpr std::size_t kLongest = 80;
  std::string result;
  for (const char letter : text.substr(0, kLongest)) {
    result += std::isprint(static_cast<unsigned char>(letter)) ? letter : '?';
  }
  return "'" + result + (text.size() > kLongest ? "..." : "") + "'";
}

int hex_value(char letter) {
  if (letter >= '0' && letter <= '9') return letter - '0';
  if (letter >= 'a' && letter <= 'f') return letter - 'a' + 10;
  if (letter >= 'A' && letter <= 'F') return letter - 'A' + 10;
  return -1;
}

/// A '%' without two hex digits behind it stays: some writers do not escape at all.
std::string percent_decoded(std::string_view uri) {
  std::string result;
  for (std::size_t i = 0; i < uri.size(); ++i) {
    const bool escape =
        uri[i] == '%' && i + 2 < uri.size() && hex_value(uri[i + 1]) >= 0 && hex_value(uri[i + 2]) >= 0;
    if (escape) {
      result += static_cast<char>(hex_value(uri[i + 1]) * 16 + hex_value(uri[i + 2]));
      i += 2;
    } else {
      result += uri[i];
    }
  }
  return result;
}

/// letter (letter | digit | + | - | .)* ':'; a drive letter is one too.
bool has_scheme(std::string_view uri) {
  const std::size_t colon = uri.find(':');
  if (colon == std::string_view::npos || colon == 0 || !std::isalpha(static_cast<unsigned char>(uri[0])))
    return false;
  return std::all_of(uri.begin(), uri.begin() + static_cast<std::ptrdiff_t>(colon), [](char letter) {
    return std::isalnum(static_cast<unsigned char>(letter)) || std::strchr("+-.", letter) != nullptr;
  });
}

std::vector<std::string> parts_of(const std::string& path) {
  std::vector<std::string> parts;
  std::size_t start = 0;
  while (start <= path.size()) {
    const std::size_t slash = std::min(path.find('/', start), path.size());
    const std::string part = path.substr(start, slash - start);
    if (!part.empty() && part != ".") parts.push_back(part);
    start = slash + 1;
  }
  return parts;
}

int base64_value(char letter) {
  if (letter >= 'A' && letter <= 'Z') return letter - 'A';
  if (letter >= 'a' && letter <= 'z') return letter - 'a' + 26;
  if (letter >= '0' && letter <= '9') return letter - '0' + 52;
  if (letter == '+' || letter == '-') return 62;
  if (letter == '/' || letter == '_') return 63;
  return -1;
}

std::vector<std::byte> base64_decoded(std::string_view text, const std::string& where) {
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  std::vector<std::byte> bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  unsigned bits = 0;
  int bit_count = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const int value = base64_value(text[i]);
    if (value < 0) refuse(where, "base64 data has a wrong letter at position " + std::to_string(i));
    bits = (bits << 6 | static_cast<unsigned>(value)) & 0xFFFFFFu;
    bit_count += 6;
    if (bit_count >= 8) {
      bit_count -= 8;
      bytes.push_back(static_cast<std::byte>(bits >> bit_count & 0xFFu));
    }
  }
  return bytes;
}

// O_NONBLOCK: opening a FIFO must not wait for a writer. It changes nothing for a regular file.
constexpr int kOpenFlags = O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY;

int open_by_kernel(int folder, const std::string& path) {
  struct open_how how {};
  how.flags = kOpenFlags;
  how.resolve = RESOLVE_BENEATH | RESOLVE_NO_MAGICLINKS;
  return static_cast<int>(::syscall(SYS_openat2, folder, path.c_str(), &how, sizeof how));
}

int open_by_hand(int folder, const std::string& path) {
  const std::vector<std::string> parts = parts_of(path);
  int at = ::dup(folder);
  for (std::size_t i = 0; at >= 0 && i < parts.size(); ++i) {
    const bool last = i + 1 == parts.size();
    const int flags = last ? kOpenFlags | O_NOFOLLOW : O_PATH | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC;
    const int next = ::openat(at, parts[i].c_str(), flags);
    const int error = errno;
    ::close(at);
    errno = error;
    at = next;
  }
  return at;
}

struct Descriptor {
  int number;
  ~Descriptor() { ::close(number); }
};

std::vector<std::byte> read_bytes(int descriptor, std::uint64_t count, const std::string& where) {
  std::vector<std::byte> bytes(count);
  std::uint64_t done = 0;
  while (done < count) {
    const ssize_t got = ::read(descriptor, bytes.data() + done, count - done);
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      throw FileError(
          FileFault::input_output, where,
          std::string("cannot read: ") + (got < 0 ? std::strerror(errno) : "the file ends early"));
    }
    done += static_cast<std::uint64_t>(got);
  }
  return bytes;
}

}  // namespace

bool is_data_uri(std::string_view uri) {
  return uri.starts_with("data:");
}

DataUri decode_data_uri(std::string_view uri, const std::string& where) {
  const std::size_t comma = uri.find(',');
  if (comma == std::string_view::npos) refuse(where, "data uri without a comma");
  const std::string_view header = uri.substr(5, comma - 5);
  if (!header.ends_with(";base64")) refuse(where, "data uri " + shown(header) + "; expected base64");
  return {std::string(header.substr(0, header.find(';'))), base64_decoded(uri.substr(comma + 1), where)};
}

std::string relative_path_of_uri(std::string_view uri, const std::string& where) {
  if (uri.empty()) refuse(where, "uri is empty");
  const std::string path = percent_decoded(uri);
  if (path.find('\0') != std::string::npos) refuse(where, "uri " + shown(uri) + " has a zero byte");
  if (has_scheme(uri) || has_scheme(path)) {
    refuse(where, "uri " + shown(uri) + " has a scheme; expected a relative path or data:");
  }
  if (path.front() == '/' || path.front() == '\\') {
    refuse(where, "uri " + shown(uri) + " is absolute; expected a path below the asset's folder");
  }
  for (const std::string& part : parts_of(path)) {
    if (part == "..") refuse(where, "uri " + shown(uri) + " leads out of the asset's folder");
  }
  return path;
}

AssetFolder::AssetFolder(const std::filesystem::path& folder, OpenBeneath how) : how_(how) {
  folder_ = ::open(folder.empty() ? "." : folder.c_str(), O_PATH | O_DIRECTORY | O_CLOEXEC);
  if (folder_ < 0) {
    throw FileError(FileFault::input_output, folder.string(),
                    std::string("cannot open: ") + std::strerror(errno));
  }
}

AssetFolder::~AssetFolder() {
  ::close(folder_);
}

int AssetFolder::open_file(const std::string& path, std::uint64_t& size, const std::string& where) const {
  int file = how_ == OpenBeneath::by_kernel ? open_by_kernel(folder_, path) : open_by_hand(folder_, path);
  // A kernel before 5.6 says ENOSYS; a sandbox that filters the call says EPERM.
  if (file < 0 && how_ == OpenBeneath::by_kernel && (errno == ENOSYS || errno == EPERM)) {
    file = open_by_hand(folder_, path);
  }
  if (file < 0 && (errno == EXDEV || errno == ELOOP)) {
    refuse(where, "uri " + shown(path) + " leads out of the asset's folder");
  }
  if (file < 0) {
    // The fault of the file that names it, unless the system itself is short of something.
    const FileFault fault =
        errno == ENOENT || errno == ENOTDIR ? FileFault::malformed : FileFault::input_output;
    throw FileError(fault, where, "cannot open " + shown(path) + ": " + std::strerror(errno));
  }
  struct stat status {};
  if (::fstat(file, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(file);
    refuse(where, "uri " + shown(path) + " is not a regular file");
  }
  size = static_cast<std::uint64_t>(status.st_size);
  return file;
}

std::vector<std::byte> AssetFolder::read_exactly(std::string_view uri, std::uint64_t bytes,
                                                 const std::string& where) const {
  std::uint64_t size = 0;
  const Descriptor file{open_file(relative_path_of_uri(uri, where), size, where)};
  if (size < bytes) {
    refuse(where, shown(uri) + " has " + std::to_string(size) + " bytes; expected " + std::to_string(bytes));
  }
  return read_bytes(file.number, bytes, where);
}

std::vector<std::byte> AssetFolder::read_up_to(std::string_view uri, std::uint64_t limit,
                                               const std::string& where) const {
  std::uint64_t size = 0;
  const Descriptor file{open_file(relative_path_of_uri(uri, where), size, where)};
  if (size > limit) {
    throw FileError(FileFault::resource, where,
                    shown(uri) + " has " + std::to_string(size) + " bytes; at most " + std::to_string(limit) +
                        " are read");
  }
  return read_bytes(file.number, size, where);
}

}  // namespace sinew
