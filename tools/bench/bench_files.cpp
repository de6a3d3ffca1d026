#include "tools/bench/bench_files.h"

#include <unistd.h>

#include <fstream>
#include <iterator>

#include "io/atomic_file.h"

namespace sinew {

void write_text(const std::filesystem::path& file, const std::string& text) {
  AtomicFile out(file);
  out.write(text);
  out.commit();
}

void write_markdown_section(const std::filesystem::path& file, const std::string& name,
                            const std::string& text) {
  std::ifstream in(file, std::ios::binary);
  std::string page(std::istreambuf_iterator<char>(in), {});
  const std::string begin = "<!-- " + name + " -->\n";
  const std::string end = "<!-- /" + name + " -->\n";
  const std::string section = begin + '\n' + text + '\n' + end;
  const std::size_t from = page.find(begin);
  const std::size_t to = page.find(end, from == std::string::npos ? page.size() : from);
  if (from == std::string::npos || to == std::string::npos) {
    if (!page.empty()) page += '\n';
    page += section;
  } else {
    page.replace(from, to + end.size() - from, section);
  }
  write_text(file, page);
}

TemporaryFile::TemporaryFile(const std::string& extension)
    : path_(std::filesystem::temp_directory_path() /
            ("sinew-bench-" + std::to_string(getpid()) + extension)) {}

TemporaryFile::~TemporaryFile() {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

}  // namespace sinew
