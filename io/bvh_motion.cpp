#include "io/bvh_motion.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "io/text_scanner.h"

namespace sinew {
namespace {

constexpr double kUsualRate = 30.0;

/// A frame time this close to 1/N, relatively, is 1/N printed with too few digits: .03333 is meant
/// as 1/30 and is exactly 1e-4 off. The rates of film and television (30/1.001) are ten times further.
constexpr double kRateTolerance = 1.0001e-4;

/// Seconds. Outside this range a frame time is not one.
constexpr double kShortestFrame = 1e-6;
constexpr double kLongestFrame = 3600.0;

struct Header {
  std::optional<long long> frames;
  std::optional<double> frame_time;
  long frames_line = 0;
  long frame_time_line = 0;
  long first_row_line = 0;
};

void read_frames(BvhText& text, Header& header) {
  if (header.frames) text.fail("a second Frames:; expected one");
  header.frames_line = text.line();
  if (text.at_line_end()) return;
  header.frames = text.take_count("frames");
  // A frame takes a byte at least: a count beyond that is no count.
  if (*header.frames > static_cast<long long>(text.bytes_left())) {
    text.fail("Frames: says " + std::to_string(*header.frames) + ", expected at most one for each of the " +
              std::to_string(text.bytes_left()) + " bytes that follow");
  }
}

void read_frame_time(BvhText& text, Header& header) {
  if (header.frame_time) text.fail("a second Frame Time:; expected one");
  header.frame_time_line = text.line();
  if (text.at_line_end()) return;
  const double seconds = text.take_number();
  const bool usable = seconds == 0.0 || (seconds >= kShortestFrame && seconds <= kLongestFrame);
  if (!usable) text.fail("the frame time is out of range; expected seconds between 1e-6 and 3600");
  header.frame_time = seconds;
}

Header read_header(BvhText& text) {
  Header header;
  for (text.skip_space();; text.skip_space()) {
    if (text.accept_label("frames")) read_frames(text, header);
    else if (text.accept_label("frame time")) read_frame_time(text, header);
    else break;
  }
  header.first_row_line = text.line();
  return header;
}

double frames_per_second(double frame_time) {
  const double whole = std::round(1.0 / frame_time);
  return std::abs(frame_time * whole - 1.0) <= kRateTolerance ? whole : 1.0 / frame_time;
}

class RowReader {
 public:
  RowReader(BvhText& text, const Header& header, std::size_t channel_count)
      : text_(text), header_(header), channel_count_(channel_count) {}

  std::vector<double> read() {
    reserve();
    const bool unterminated = text_.ends_inside_line();
    const bool cut_word = unterminated && text_.drop_cut_word();
    while (find_row()) read_row();
    // Of a file cut inside a row, all rows but the last are good and the last is short.
    const bool good_till_last = bad_line_ == 0 || (bad_line_ == last_line_ && bad_length_ < channel_count_);
    if (unterminated && good_till_last && (cut_word || bad_line_ != 0)) drop_cut_row();
    else if (bad_line_ != 0) join_wrapped_rows();
    if (values_.empty()) {
      text_.fail("no motion; expected rows of " + std::to_string(channel_count_) + " values");
    }
    compare_with_header();
    return std::move(values_);
  }

 private:
  void reserve() {
    const std::size_t most = text_.bytes_left() / 2 + 1;  // a digit and a blank each
    const auto frames = static_cast<std::size_t>(header_.frames.value_or(0));
    values_.reserve(frames < most / channel_count_ ? (frames + 1) * channel_count_ : most);
  }

  /// Steps to the next row; false where the motion ends.
  bool find_row() {
    text_.skip_blanks();
    while (!text_.at_end() && (text_.at_line_end() || text_.peek_word().starts_with('#'))) {
      if (!text_.at_line_end()) note_text("a comment between or after the rows; it is skipped");
      text_.skip_line();
      text_.skip_blanks();
    }
    if (text_.at_end()) return false;
    const bool all_there = header_.frames && values_.size() >= static_cast<std::size_t>(*header_.frames) * channel_count_;
    if (!all_there || text_.looks_like_number()) return true;
    note_text("found " + in_quotes(text_.peek_word()) + " after the last row; the rest is ignored");
    return false;
  }

  void note_text(const std::string& what) {
    if (std::exchange(text_noted_, true)) return;
    text_.warn("W_BVH_TEXT_IN_MOTION", text_.line(), what);
  }

  void read_row() {
    const std::size_t before = values_.size();
    last_line_ = text_.line();
    for (; !text_.at_line_end(); text_.skip_blanks()) values_.push_back(text_.take_number());
    const std::size_t length = values_.size() - before;
    if (length == channel_count_ || bad_line_ != 0) return;
    bad_line_ = last_line_;
    bad_length_ = length;
  }

  void drop_cut_row() {
    values_.resize(values_.size() / channel_count_ * channel_count_);
    text_.warn("W_BVH_CUT_ROW", text_.line(), "the file ends inside a row; that row is left out");
  }

  void join_wrapped_rows() {
    if (values_.size() % channel_count_ != 0) {
      text_.fail_at(bad_line_, "row has " + std::to_string(bad_length_) + " values; expected " +
                                   std::to_string(channel_count_));
    }
    text_.warn("W_BVH_WRAPPED_ROWS", bad_line_,
               "row has " + std::to_string(bad_length_) + " values, a frame " + std::to_string(channel_count_) +
                   "; values are taken without regard to lines");
  }

  void compare_with_header() {
    const std::size_t rows = values_.size() / channel_count_;
    if (!header_.frames) {
      text_.warn("W_BVH_NO_FRAME_COUNT", header_.first_row_line,
                 "no number of frames; the " + std::to_string(rows) + " present are used");
      return;
    }
    const auto declared = static_cast<std::size_t>(*header_.frames);
    if (rows == declared) return;
    text_.warn(rows > declared ? "W_BVH_EXTRA_ROWS" : "W_BVH_MISSING_ROWS", header_.frames_line,
               std::to_string(rows) + " rows of motion, Frames: says " + std::to_string(declared) +
                   "; the rows present are used");
  }

  BvhText& text_;
  const Header& header_;
  const std::size_t channel_count_;
  std::vector<double> values_;
  long last_line_ = 0;
  long bad_line_ = 0;  // first row that is not of a frame's length; 0: none
  std::size_t bad_length_ = 0;
  bool text_noted_ = false;
};

}  // namespace

BvhMotion read_bvh_motion(BvhText& text, std::size_t channel_count) {
  const long motion_line = text.line();
  if (channel_count == 0) text.fail("no joint has channels; expected at least one that moves");
  Header header = read_header(text);
  if (header.frame_time_line == 0) header.frame_time_line = motion_line;
  BvhMotion motion;
  if (header.frame_time.value_or(0.0) > 0.0) {
    motion.frames_per_second = frames_per_second(*header.frame_time);
  } else {
    motion.frames_per_second = kUsualRate;
    text.warn("W_BVH_NO_FRAME_TIME", header.frame_time_line, "no frame time, or zero; 30 frames per second are assumed");
  }
  motion.first_line = header.first_row_line;
  motion.values = RowReader(text, header, channel_count).read();
  motion.frame_count = static_cast<int>(motion.values.size() / channel_count);
  return motion;
}

}  // namespace sinew
