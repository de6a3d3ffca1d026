#include "tools/output_pattern.h"

#include <charconv>
#include <string>

namespace sinew {
namespace {

std::string padded(int frame, std::size_t width) {
  std::string digits = std::to_string(frame);
  if (digits.size() < width) digits.insert(0, width - digits.size(), '0');
  return digits;
}

}  // namespace

std::filesystem::path numbered(const std::filesystem::path& pattern, int frame) {
  std::string name = pattern.filename().string();
  if (const std::size_t start = name.find('#'); start != std::string::npos) {
    const std::size_t end = std::min(name.find_first_not_of('#', start), name.size());
    name.replace(start, end - start, padded(frame, end - start));
  } else if (const std::size_t brace = name.find("{frame"); brace != std::string::npos && name.find('}', brace) != std::string::npos) {
    const std::size_t close = name.find('}', brace);
    const std::size_t colon = name.find(':', brace);
    std::size_t width = 0;
    if (colon < close) std::from_chars(name.data() + colon + 1, name.data() + close, width);
    name.replace(brace, close + 1 - brace, padded(frame, std::min<std::size_t>(width, 20)));
  } else {
    name = pattern.stem().string() + '_' + padded(frame, 4) + pattern.extension().string();
  }
  return pattern.parent_path() / name;
}

}  // namespace sinew
