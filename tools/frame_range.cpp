#include "tools/frame_range.h"

#include <charconv>
#include <stdexcept>
#include <string_view>

namespace sinew {
namespace {

[[noreturn]] void refuse(const std::string& text) {
  throw std::invalid_argument("--frames: found '" + text +
                              "', expected FRAME, FIRST-LAST or FIRST-LASTxSTEP (first frame 1, -1 the last)");
}

int take_number(std::string_view& rest, const std::string& text) {
  int value = 0;
  const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
  if (error != std::errc() || value == 0) refuse(text);
  rest.remove_prefix(static_cast<std::size_t>(end - rest.data()));
  return value;
}

}  // namespace

FrameRange parse_frame_range(const std::string& text) {
  std::string_view rest = text;
  FrameRange range;
  range.first = range.last = take_number(rest, text);
  if (!rest.empty() && rest.front() == '-') {
    rest.remove_prefix(1);
    range.last = take_number(rest, text);
  }
  if (!rest.empty() && rest.front() == 'x') {
    rest.remove_prefix(1);
    range.step = take_number(rest, text);
  }
  if (!rest.empty() || range.step < 1) refuse(text);
  return range;
}

FrameRange resolve(const FrameRange& range, int frame_count) {
  const auto index = [&](int frame) { return frame > 0 ? frame - 1 : frame_count + frame; };
  FrameRange resolved{index(range.first), index(range.last), range.step};
  if (resolved.last >= frame_count) resolved.last = frame_count - 1;
  if (resolved.first < 0) resolved.first = 0;
  if (resolved.first > resolved.last) {
    throw std::invalid_argument("--frames: the clip has " + std::to_string(frame_count) + " frames, none of them in " +
                                std::to_string(range.first) + "-" + std::to_string(range.last));
  }
  return resolved;
}

}  // namespace sinew
