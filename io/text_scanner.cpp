#include "io/text_scanner.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "io/file_error.h"

namespace sinew {
namespace {

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }

// from_chars does not know a leading plus, which printf("%+g") writes.
std::string_view without_plus(std::string_view word) {
  const bool plus = word.size() > 1 && word[0] == '+' && word[1] != '-' && word[1] != '+';
  return plus ? word.substr(1) : word;
}

/// A number from_chars found out of range for a double: 0 when it is too small.
double out_of_range_number(std::string_view word, const TextPlace& place) {
  long double wide = 0;
  const auto read = std::from_chars(word.data(), word.data() + word.size(), wide);
  if (read.ec == std::errc() && std::abs(wide) < 1) return 0.0;
  place.fail(in_quotes(word) + " is out of range for a number");
}

}  // namespace

LineReader::LineReader(std::string_view text) : rest_(text) {
  if (rest_.starts_with("\xEF\xBB\xBF")) rest_.remove_prefix(3);
}

bool LineReader::next() {
  if (rest_.empty()) return false;
  const std::size_t end = std::min(rest_.find_first_of("\r\n"), rest_.size());
  line_ = rest_.substr(0, end);
  const bool crlf = rest_.substr(end).starts_with("\r\n");
  rest_.remove_prefix(std::min(rest_.size(), end + (crlf ? 2 : 1)));
  ++number_;
  return true;
}

std::string_view take_word(std::string_view& line) {
  std::size_t begin = 0;
  while (begin < line.size() && is_blank(line[begin])) ++begin;
  std::size_t end = begin;
  while (end < line.size() && !is_blank(line[end])) ++end;
  const std::string_view word = line.substr(begin, end - begin);
  line.remove_prefix(end);
  return word;
}

std::string_view trimmed(std::string_view line) {
  while (!line.empty() && is_blank(line.front())) line.remove_prefix(1);
  while (!line.empty() && is_blank(line.back())) line.remove_suffix(1);
  return line;
}

int count_words(std::string_view line) {
  int count = 0;
  while (!take_word(line).empty()) ++count;
  return count;
}

bool equal_ignoring_case(std::string_view a, std::string_view b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](char x, char y) { return lower(x) == lower(y); });
}

std::string in_quotes(std::string_view word) {
  constexpr std::size_t kLongest = 40;
  std::string text(word.substr(0, kLongest));
  for (char& c : text) {
    if (c < ' ' || c > '~') c = '?';
  }
  return "'" + text + (word.size() > kLongest ? "...'" : "'");
}

std::size_t utf8_length(std::string_view text) {
  const auto byte = [text](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  if (byte(0) < 0x80) return 1;
  const std::size_t length = byte(0) >= 0xF0 ? 4 : byte(0) >= 0xE0 ? 3 : 2;
  if (byte(0) < 0xC0 || byte(0) >= 0xF8 || length > text.size()) return 0;
  std::uint32_t code = byte(0) & (0x7F >> length);
  for (std::size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xC0) != 0x80) return 0;
    code = code << 6 | (byte(i) & 0x3F);
  }
  constexpr std::uint32_t kLeast[] = {0, 0, 0x80, 0x800, 0x10000};  // below it, a shorter form exists
  const bool surrogate = code >= 0xD800 && code < 0xE000;
  return code >= kLeast[length] && code <= 0x10FFFF && !surrogate ? length : 0;
}

std::string printable_name(std::string_view rest) {
  rest = trimmed(rest).substr(0, 256);
  std::string name;
  while (!rest.empty()) {
    const std::size_t length = utf8_length(rest);
    const bool control = rest[0] >= 0 && (rest[0] < ' ' || rest[0] == 0x7F);
    name += length > 0 && !control ? rest.substr(0, length) : "?";
    rest.remove_prefix(std::max<std::size_t>(1, length));
  }
  return name;
}

std::string counted(std::int64_t count, std::string_view one, std::string_view many) {
  return std::to_string(count) + " " + std::string(count == 1 ? one : many);
}

void TextPlace::fail(const std::string& what) const { throw FileError(file, line, what); }

double to_number(std::string_view word, const TextPlace& place) {
  const std::string_view digits = without_plus(word);
  double value = 0;
  const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (read.ec == std::errc::invalid_argument || read.ptr != digits.data() + digits.size()) {
    place.fail(in_quotes(word) + " is not a number");
  }
  if (read.ec == std::errc::result_out_of_range) return out_of_range_number(digits, place);
  if (!std::isfinite(value)) place.fail(in_quotes(word) + " is not a finite number");
  return value;
}

std::int64_t to_integer(std::string_view word, const TextPlace& place) {
  const std::string_view digits = without_plus(word);
  std::int64_t value = 0;
  const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (read.ec == std::errc::result_out_of_range) place.fail(in_quotes(word) + " is out of range for a whole number");
  if (read.ec != std::errc() || read.ptr != digits.data() + digits.size()) {
    place.fail(in_quotes(word) + " is not a whole number");
  }
  return value;
}

void refuse_disguises(std::string_view bytes, const std::filesystem::path& file, const std::string& expected) {
  const auto refuse = [&](const std::string& found, const std::string& advice) {
    throw FileError(FileFault::malformed, file.string(), "is " + found + ", not " + expected + "; " + advice);
  };
  if (bytes.starts_with("version https://git-lfs.github.com/spec/")) {
    refuse("a Git LFS pointer", "fetch what it points to with 'git lfs pull'");
  }
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF")) refuse("UTF-16 text", "save it as UTF-8");
  if (bytes.starts_with("\x1F\x8B") || bytes.starts_with("PK\x03\x04")) {
    refuse("a compressed file", "unpack it first");
  }
  LineReader lines(bytes.substr(0, 1024));
  while (lines.next() && trimmed(lines.line()).empty()) continue;
  const std::string_view line = trimmed(lines.line());
  const auto begins = [&](std::string_view with) { return equal_ignoring_case(line.substr(0, with.size()), with); };
  if (begins("<!doctype") || begins("<html")) refuse("a web page", "download the file itself");
}

}  // namespace sinew
