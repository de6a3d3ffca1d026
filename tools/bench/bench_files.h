#pragma once

#include <filesystem>
#include <string>

namespace sinew {

/// Writes `text` whole or not at all. Throws FileError.
void write_text(const std::filesystem::path& file, const std::string& text);

/// Puts `text` into a Markdown file between the lines "<!-- NAME -->" and "<!-- /NAME -->". A file that has
/// no such lines, or is not there yet, gets them at its end. So a page's tables are made anew by one command
/// and what is written round them stays. Throws FileError.
void write_markdown_section(const std::filesystem::path& file, const std::string& name,
                            const std::string& text);

/// A name for a file of this process that is gone when this is.
class TemporaryFile {
 public:
  explicit TemporaryFile(const std::string& extension);
  ~TemporaryFile();
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace sinew
