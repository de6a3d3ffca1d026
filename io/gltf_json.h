#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

namespace sinew {

/// A value of a glTF file's JSON together with where it stands, so that whatever is wrong with it is
/// told as FILE:/json/pointer. Borrows both the document it points into and the file's name.
class JsonPlace {
 public:
  JsonPlace(const std::string& file, const nlohmann::json& root) : file_(&file), value_(&root) {}

  [[noreturn]] void fail(const std::string& what) const;
  std::string where() const { return *file_ + ":" + (pointer_.empty() ? "/" : pointer_); }
  const nlohmann::json& value() const { return *value_; }

  bool has(const char* key) const { return value_->is_object() && value_->contains(key); }
  /// Fails when there is no such member; so do the accessors below when the kind is another.
  JsonPlace member(const std::string& key) const;
  JsonPlace element(std::size_t index) const;
  std::optional<JsonPlace> find(const char* key) const;

  void expect_object() const;
  std::size_t array_size() const;
  std::uint64_t whole_number() const;
  double number() const;
  const std::string& text() const;
  /// A whole number below `count`; `what` names the things counted.
  int index_below(std::size_t count, const char* what) const;
  /// An array of exactly `count` numbers.
  void expect_numbers(std::size_t count) const;

  std::uint64_t whole_number_or(const char* key, std::uint64_t otherwise) const;
  std::string text_or(const char* key, const std::string& otherwise) const;
  /// -1 where the member is absent.
  int index_or_none(const char* key, std::size_t count, const char* what) const;

 private:
  JsonPlace(const std::string* file, std::string pointer, const nlohmann::json& value)
      : file_(file), pointer_(std::move(pointer)), value_(&value) {}

  const std::string* file_;
  std::string pointer_;
  const nlohmann::json* value_;
};

}  // namespace sinew
