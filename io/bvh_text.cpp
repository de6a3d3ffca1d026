#include "io/bvh_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include "io/file_error.h"
#include "io/text_scanner.h"

namespace sinew {
namespace {

/// Larger values, lengths or degrees, are refused: no body and no turn is that large in any unit,
/// and sums and squares of smaller ones stay finite.
constexpr double kGreatestNumber = 1e12;

bool is_digit(char c) { return c >= '0' && c <= '9'; }
char lower(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }
bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
bool ends_word(char c) { return is_blank(c) || c == '\n' || c == '\r' || c == '{' || c == '}'; }

/// Takes one sign off `word`; true for '-'. A '+' after it goes too: some exporters print their own
/// minus before a format that prints a plus.
bool take_sign(std::string_view& word) {
  const bool negative = word.starts_with('-');
  if (negative || word.starts_with('+')) word.remove_prefix(1);
  if (negative && word.starts_with('+')) word.remove_prefix(1);
  return negative;
}

/// Whether a decimal number too long for a double is so because it is small.
bool underflows(std::string_view digits) {
  const std::size_t exponent = digits.find_first_of("eE");
  if (exponent != std::string_view::npos) return digits.substr(exponent + 1).starts_with('-');
  return digits.substr(0, digits.find('.')).find_first_not_of('0') == std::string_view::npos;
}

enum class Reading { number, not_a_number, not_finite, too_large };

Reading read_number(std::string_view word, double& value) {
  const bool negative = take_sign(word);
  if (equal_ignoring_case(word.substr(0, 3), "nan") || equal_ignoring_case(word.substr(0, 3), "inf")) return Reading::not_finite;
  // from_chars would take a further minus.
  if (word.empty() || !(is_digit(word[0]) || word[0] == '.')) return Reading::not_a_number;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error == std::errc::invalid_argument || end != word.data() + word.size()) return Reading::not_a_number;
  if (error == std::errc::result_out_of_range) {
    if (!underflows(word)) return Reading::too_large;
    value = 0.0;
  }
  if (negative) value = -value;
  return std::abs(value) <= kGreatestNumber ? Reading::number : Reading::too_large;
}

/// -?digits,digits with an optional exponent: one comma, in the place of the point.
bool has_decimal_comma(std::string_view word) {
  take_sign(word);
  const std::size_t comma = word.find(',');
  return comma != std::string_view::npos && comma > 0 && comma + 1 < word.size() && is_digit(word[comma + 1]) &&
         std::all_of(word.begin(), word.begin() + static_cast<std::ptrdiff_t>(comma), is_digit) &&
         word.find(',', comma + 1) == std::string_view::npos;
}

}  // namespace

BvhText::BvhText(std::string_view text, const std::filesystem::path& name) : text_(text), name_(name) {
  if (text_.starts_with("\xEF\xBB\xBF")) at_ = 3;
}

bool BvhText::ends_inside_line() const { return !text_.empty() && text_.back() != '\n' && text_.back() != '\r'; }

bool BvhText::drop_cut_word() {
  std::size_t begin = text_.size();
  while (begin > at_ && !ends_word(text_[begin - 1])) --begin;
  const std::string_view word = text_.substr(begin);
  double value = 0.0;
  if (word.empty() || word.find_first_not_of("+-.,0123456789eE") != std::string_view::npos) return false;
  if (has_decimal_comma(word) || read_number(word, value) != Reading::not_a_number) return false;
  text_ = text_.substr(0, begin);
  return true;
}

/// Bytes of the blank at `at`, 0 if none is there. A no-break space comes with text pasted from web pages.
std::size_t BvhText::blank_length(std::size_t at) const {
  if (at >= text_.size()) return 0;
  if (is_blank(text_[at])) return 1;
  return text_.substr(at, 2) == "\xC2\xA0" ? 2 : 0;
}

void BvhText::skip_blanks() {
  while (const std::size_t length = blank_length(at_)) at_ += length;
}

void BvhText::skip_line() {
  at_ = std::min(text_.find_first_of("\r\n", at_), text_.size());
  if (at_end()) return;
  at_ += text_.substr(at_, 2) == "\r\n" ? 2 : 1;
  ++line_;
}

void BvhText::skip_space() {
  for (skip_blanks(); !at_end() && (at_line_end() || text_[at_] == '#'); skip_blanks()) skip_line();
}

std::size_t BvhText::word_end(std::size_t at) const {
  if (at < text_.size() && (text_[at] == '{' || text_[at] == '}')) return at + 1;
  while (at < text_.size() && !ends_word(text_[at]) && blank_length(at) == 0) ++at;
  return at;
}

std::string_view BvhText::peek_word() const { return text_.substr(at_, word_end(at_) - at_); }

std::string_view BvhText::take_word() {
  const std::string_view word = peek_word();
  at_ += word.size();
  return word;
}

bool BvhText::accept(std::string_view keyword) {
  skip_space();
  const std::string_view word = peek_word();
  if (!equal_ignoring_case(word, keyword)) return false;
  at_ += word.size();
  return true;
}

bool BvhText::accept_label(std::string_view label) {
  const std::size_t before = at_;
  bool matches = true;
  for (std::size_t i = 0; matches && i < label.size(); ++i) {
    if (label[i] == ' ') skip_blanks();
    else matches = !at_end() && lower(text_[at_++]) == label[i];
  }
  matches = matches && (at_line_end() || blank_length(at_) > 0 || text_[at_] == ':');
  if (!matches) {
    at_ = before;
    return false;
  }
  skip_blanks();
  if (!at_end() && text_[at_] == ':') ++at_;
  skip_blanks();
  return true;
}

void BvhText::expect(std::string_view keyword) {
  if (!accept(keyword)) fail_expecting(std::string(keyword));
}

std::string_view BvhText::take_name() {
  skip_blanks();
  const std::size_t begin = at_;
  at_ = std::min(text_.find_first_of("\r\n{", at_), text_.size());
  std::string_view name = text_.substr(begin, at_ - begin);
  while (!name.empty() && is_blank(name.back())) name.remove_suffix(1);
  return name;
}

bool BvhText::looks_like_number() const {
  std::string_view word = peek_word();
  take_sign(word);
  return !word.empty() && (is_digit(word[0]) || word[0] == '.' || equal_ignoring_case(word.substr(0, 3), "nan") ||
                           equal_ignoring_case(word.substr(0, 3), "inf"));
}

double BvhText::take_number() {
  skip_blanks();
  // Nearly every number is plain; what is not, and what is wrong, is sorted out word by word.
  const char* const begin = text_.data() + at_;
  const char* const last = text_.data() + text_.size();
  double value = 0.0;
  const auto [end, error] = std::from_chars(begin, last, value);
  const bool plain = error == std::errc() && (end == last || ends_word(*end)) && decimal_mark_ != DecimalMark::comma &&
                     std::abs(value) <= kGreatestNumber;
  if (!plain) return parse_word_as_number();
  decimal_mark_ = DecimalMark::point;
  at_ += static_cast<std::size_t>(end - begin);
  return value;
}

double BvhText::parse_word_as_number() {
  const std::string_view word = peek_word();
  double value = 0.0;
  if (has_decimal_comma(word)) {
    value = parse_decimal_comma(word);
  } else {
    switch (read_number(word, value)) {
      case Reading::number: break;
      case Reading::not_a_number: fail_expecting("a number");
      case Reading::not_finite: fail_expecting("a finite number");
      case Reading::too_large: fail_expecting("a number of magnitude up to 1e12");
    }
    if (decimal_mark_ == DecimalMark::comma) fail_expecting("a number with a decimal comma, as before");
    decimal_mark_ = DecimalMark::point;
  }
  at_ += word.size();
  return value;
}

/// Commas are taken for points only where nothing contradicts it: "1,5" could be two numbers. So
/// every number must have one, and the file no point anywhere.
double BvhText::parse_decimal_comma(std::string_view word) {
  if (decimal_mark_ == DecimalMark::unknown && text_.find('.') == std::string_view::npos) {
    decimal_mark_ = DecimalMark::comma;
    warn("W_BVH_DECIMAL_COMMA", line_, "numbers have a decimal comma; read as a point");
  }
  if (decimal_mark_ != DecimalMark::comma) fail_expecting("a number with a decimal point");
  std::string with_point(word);
  std::replace(with_point.begin(), with_point.end(), ',', '.');
  double value = 0.0;
  if (read_number(with_point, value) != Reading::number) fail_expecting("a number");
  return value;
}

long long BvhText::take_count(std::string_view of_what) {
  skip_blanks();
  std::string_view digits = peek_word();
  const std::size_t length = digits.size();
  if (digits.starts_with('+')) digits.remove_prefix(1);
  long long count = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), count);
  if (error != std::errc() || end != digits.data() + digits.size() || count < 0) {
    fail_expecting("the number of " + std::string(of_what));
  }
  at_ += length;
  return count;
}

void BvhText::fail_at(long line, const std::string& what) const { throw FileError(name_, line, what); }

void BvhText::fail_expecting(const std::string& expected) const {
  const std::string found = at_end() ? "the file ends" : at_line_end() ? "the line ends" : "found " + in_quotes(peek_word());
  fail(found + "; expected " + expected);
}

void BvhText::warn(const char* code, long line, const std::string& what) {
  warnings_.push_back(std::string(code) + ": " + name_.string() + ":" + std::to_string(line) + ": " + what);
}

}  // namespace sinew
