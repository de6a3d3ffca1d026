#include "io/gltf_json.h"

#include <cmath>

#include "io/file_error.h"

namespace sinew {
namespace {

/// RFC 6901: '~' and '/' inside a key are escaped.
std::string escaped(const std::string& key) {
  std::string result;
  for (const char letter : key) {
    if (letter == '~')
      result += "~0";
    else if (letter == '/')
      result += "~1";
    else
      result += static_cast<unsigned char>(letter) < 0x20 ? '?' : letter;
  }
  return result;
}

}  // namespace

void JsonPlace::fail(const std::string& what) const {
  throw FileError(FileFault::malformed, where(), what);
}

JsonPlace JsonPlace::member(const std::string& key) const {
  expect_object();
  const auto found = value_->find(key);
  if (found == value_->end()) fail("'" + escaped(key) + "' is missing");
  return {file_, pointer_ + "/" + escaped(key), *found};
}

JsonPlace JsonPlace::element(std::size_t index) const {
  return {file_, pointer_ + "/" + std::to_string(index), (*value_)[index]};
}

std::optional<JsonPlace> JsonPlace::find(const char* key) const {
  if (!has(key)) return std::nullopt;
  return member(key);
}

void JsonPlace::expect_object() const {
  if (!value_->is_object()) fail(std::string("found ") + value_->type_name() + ", expected an object");
}

std::size_t JsonPlace::array_size() const {
  if (!value_->is_array()) fail(std::string("found ") + value_->type_name() + ", expected an array");
  return value_->size();
}

std::uint64_t JsonPlace::whole_number() const {
  // "1.0" is not a whole number to glTF, which asks for integers without a fraction part.
  if (!value_->is_number_unsigned()) {
    const std::string found = value_->is_number() ? value_->dump() : value_->type_name();
    fail("found " + found + ", expected a whole number, 0 or more");
  }
  return value_->get<std::uint64_t>();
}

double JsonPlace::number() const {
  if (!value_->is_number()) fail(std::string("found ") + value_->type_name() + ", expected a number");
  const double number = value_->get<double>();
  if (!std::isfinite(number)) fail("number is not finite");
  return number;
}

const std::string& JsonPlace::text() const {
  if (!value_->is_string()) fail(std::string("found ") + value_->type_name() + ", expected a string");
  return value_->get_ref<const std::string&>();
}

int JsonPlace::index_below(std::size_t count, const char* what) const {
  const std::uint64_t index = whole_number();
  if (index >= count) {
    fail("index " + std::to_string(index) + " is out of range; the file has " + std::to_string(count) + " " +
         what);
  }
  return static_cast<int>(index);
}

void JsonPlace::expect_numbers(std::size_t count) const {
  if (array_size() != count) {
    fail("found " + std::to_string(array_size()) + " numbers, expected " + std::to_string(count));
  }
  for (std::size_t i = 0; i < count; ++i) element(i).number();
}

std::uint64_t JsonPlace::whole_number_or(const char* key, std::uint64_t otherwise) const {
  return has(key) ? member(key).whole_number() : otherwise;
}

std::string JsonPlace::text_or(const char* key, const std::string& otherwise) const {
  return has(key) ? member(key).text() : otherwise;
}

int JsonPlace::index_or_none(const char* key, std::size_t count, const char* what) const {
  return has(key) ? member(key).index_below(count, what) : -1;
}

}  // namespace sinew
