#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace sinew {

/// A place in the text of a BVH file: takes words, names, numbers and line ends from it, knows the
/// line it stands on, and collects warnings. LF, CRLF and CR end a line; no locale is asked.
class BvhText {
 public:
  /// Borrows `text`. A byte order mark is stepped over.
  BvhText(std::string_view text, const std::filesystem::path& name);

  long line() const { return line_; }
  std::size_t bytes_left() const { return text_.size() - at_; }
  bool at_end() const { return at_ == text_.size(); }
  bool at_line_end() const { return at_end() || text_[at_] == '\n' || text_[at_] == '\r'; }
  /// Whether the last line lacks its line end: a sign that the file was cut.
  bool ends_inside_line() const;
  /// Leaves off a last word that begins a number but is none ("-", "1.5e"), as a cut file has. True if so.
  bool drop_cut_word();

  void skip_blanks();
  void skip_line();
  /// Skips blanks, line ends, and comments from '#' to the end of their line.
  void skip_space();

  /// The word here, without taking it: up to a blank, a line end or a brace; a brace is a word.
  std::string_view peek_word() const;
  std::string_view take_word();
  /// Takes the next word if it is `keyword` in any case; skips space before it.
  bool accept(std::string_view keyword);
  /// Takes "label", "label :" and the like in any case, any blanks standing for one in `label`.
  bool accept_label(std::string_view label);
  void expect(std::string_view keyword);
  /// The rest of the line or what of it comes before '{', without blanks around it.
  std::string_view take_name();
  /// Whether a number, or what was meant as one, begins here.
  bool looks_like_number() const;
  /// A finite number of magnitude up to 1e12.
  double take_number();
  /// A whole number, not negative.
  long long take_count(std::string_view of_what);

  [[noreturn]] void fail(const std::string& what) const { fail_at(line_, what); }
  [[noreturn]] void fail_at(long line, const std::string& what) const;
  /// Fails with the word here as what was found.
  [[noreturn]] void fail_expecting(const std::string& expected) const;
  void warn(const char* code, long line, const std::string& what);
  std::vector<std::string> take_warnings() { return std::move(warnings_); }

 private:
  enum class DecimalMark { unknown, point, comma };

  std::size_t blank_length(std::size_t at) const;
  std::size_t word_end(std::size_t at) const;
  double parse_word_as_number();
  double parse_decimal_comma(std::string_view word);

  std::string_view text_;
  std::filesystem::path name_;
  std::size_t at_ = 0;
  long line_ = 1;
  DecimalMark decimal_mark_ = DecimalMark::unknown;
  std::vector<std::string> warnings_;
};

}  // namespace sinew
