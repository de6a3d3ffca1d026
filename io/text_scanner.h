#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace sinew {

/// Lines of a text, whatever ends them: LF, CRLF or CR alone. A UTF-8 byte order mark is skipped.
/// The lines are views of the text, which must outlive them.
class LineReader {
 public:
  explicit LineReader(std::string_view text);

  /// Moves to the next line; false when there is none left.
  bool next();
  std::string_view line() const { return line_; }
  long number() const { return number_; }  ///< of line(), counted from 1
  std::size_t bytes_left() const { return rest_.size(); }

 private:
  std::string_view rest_;
  std::string_view line_;
  long number_ = 0;
};

/// Removes and returns the next word of `line`, words being parted by blanks; empty at the end.
std::string_view take_word(std::string_view& line);
std::string_view trimmed(std::string_view line);
int count_words(std::string_view line);
bool equal_ignoring_case(std::string_view a, std::string_view b);

/// `word` in single quotes, cut to a readable length, with what does not print shown as '?'.
std::string in_quotes(std::string_view word);
/// Bytes of the UTF-8 character at the front of `text`, which is not empty; 0 when there is no valid one.
std::size_t utf8_length(std::string_view text);
/// What follows a keyword as a name: trimmed, at most 256 bytes, valid UTF-8; '?' for what is not.
std::string printable_name(std::string_view rest);
/// "1 vertex", "3 vertices".
std::string counted(std::int64_t count, std::string_view one, std::string_view many);

/// A line of a text file, for errors.
struct TextPlace {
  const std::filesystem::path& file;
  long line;
  /// Throws FileError (malformed).
  [[noreturn]] void fail(const std::string& what) const;
};

/// A finite number, a dot as its decimal point whatever the locale. Too small to be told from zero
/// is zero. Throws FileError at `place`.
double to_number(std::string_view word, const TextPlace& place);
std::int64_t to_integer(std::string_view word, const TextPlace& place);

/// Refuses what is often found under the name of another file, saying what to do: a Git LFS pointer,
/// a web page, UTF-16, a compressed file. `expected` as in "an OBJ file". Throws FileError.
void refuse_disguises(std::string_view bytes, const std::filesystem::path& file, const std::string& expected);

}  // namespace sinew
