// PLY, after Greg Turk's "The PLY Polygon File Format" (Stanford, 1994).
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <optional>
#include <string>

#include "io/file_error.h"
#include "io/mesh_reader.h"
#include "io/text_scanner.h"

namespace sinew {
namespace {

enum class Scalar { i8, u8, i16, u16, i32, u32, f32, f64 };

int size_of(Scalar type) {
  constexpr int kSizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
  return kSizes[static_cast<int>(type)];
}

std::optional<Scalar> scalar_from_name(std::string_view name) {
  struct Name {
    std::string_view old, sized;
    Scalar type;
  };
  constexpr Name kNames[] = {{"char", "int8", Scalar::i8},     {"uchar", "uint8", Scalar::u8},
                             {"short", "int16", Scalar::i16},  {"ushort", "uint16", Scalar::u16},
                             {"int", "int32", Scalar::i32},    {"uint", "uint32", Scalar::u32},
                             {"float", "float32", Scalar::f32}, {"double", "float64", Scalar::f64}};
  for (const Name& known : kNames) {
    if (name == known.old || name == known.sized) return known.type;
  }
  return std::nullopt;
}

struct Property {
  std::string name;
  Scalar type = Scalar::f32;
  std::optional<Scalar> count_type;  ///< of a list: the type of its length
};

struct Element {
  std::string name;
  std::int64_t count = 0;
  std::vector<Property> properties;
};

enum class Encoding { text, little, big };

/// The values of a PLY body one after the other, whatever their encoding.
class PlyBody {
 public:
  PlyBody(std::string_view bytes, std::size_t header_size, LineReader lines, Encoding encoding,
          const std::filesystem::path& name)
      : bytes_(bytes), byte_(header_size), lines_(lines), encoding_(encoding), name_(name) {}

  std::size_t bytes_left() const {
    return encoding_ == Encoding::text ? lines_.bytes_left() : bytes_.size() - byte_;
  }
  std::string where() const {
    const bool text = encoding_ == Encoding::text;
    return name_.string() + (text ? ":" + std::to_string(lines_.number()) : "@" + std::to_string(byte_));
  }
  [[noreturn]] void fail(const std::string& what) const { throw FileError(FileFault::malformed, where(), what); }

  /// Fewest bytes an item can take: in text a digit for each property, parted by blanks or a line end.
  std::size_t least_size(const Element& element) const {
    std::size_t size = 0;
    for (const Property& property : element.properties) {
      size += encoding_ == Encoding::text ? 2 : size_of(property.count_type.value_or(property.type));
    }
    return std::max<std::size_t>(1, encoding_ == Encoding::text && size > 0 ? size - 1 : size);
  }

  /// To be called before each item: in text an item is a line.
  void begin_item(const Element& element, std::int64_t index) {
    if (encoding_ != Encoding::text) return;
    do {
      if (!lines_.next()) {
        fail("file ends after " + std::to_string(index) + " of " + std::to_string(element.count) + " items of " +
             in_quotes(element.name));
      }
      line_ = trimmed(lines_.line());
    } while (line_.empty());
  }

  /// To be called after each item.
  void end_item() {
    if (encoding_ == Encoding::text && !take_word(line_).empty()) fail("line has more values than its element has properties");
  }

  double number(Scalar type) {
    const double value = encoding_ == Encoding::text ? to_number(word(), {name_, lines_.number()}) : binary(type);
    if (!std::isfinite(value)) {
      byte_ -= size_of(type);
      fail("value is not a finite number");
    }
    return value;
  }

  std::int64_t integer(Scalar type) {
    if (encoding_ == Encoding::text) return to_integer(word(), {name_, lines_.number()});
    const double value = binary(type);
    if (!(std::abs(value) <= 4294967295.0)) fail("value is not a whole number");
    return static_cast<std::int64_t>(value);
  }

  /// The length of a list, which the bytes left can hold.
  std::int64_t list_length(const Property& property) {
    const std::int64_t length = integer(*property.count_type);
    const std::size_t each = encoding_ == Encoding::text ? 1 : size_of(property.type);
    const std::size_t left = encoding_ == Encoding::text ? line_.size() : bytes_left();
    if (length < 0) fail("list has the length " + std::to_string(length));
    check_count(length, each, left, where(), "values of " + in_quotes(property.name));
    return length;
  }

  void skip(const Property& property) {
    const std::int64_t values = property.count_type ? list_length(property) : 1;
    for (std::int64_t i = 0; i < values; ++i) {
      if (encoding_ == Encoding::text) {
        word();
      } else {
        take(size_of(property.type));
      }
    }
  }

 private:
  std::string_view word() {
    const std::string_view found = take_word(line_);
    if (found.empty()) fail("line ends too soon; expected another value");
    return found;
  }

  const char* take(std::size_t size) {
    if (bytes_.size() - byte_ < size) fail("file ends too soon; expected another value");
    byte_ += size;
    return bytes_.data() + byte_ - size;
  }

  template <class T>
  double take_as() {
    std::array<char, sizeof(T)> raw;
    std::memcpy(raw.data(), take(sizeof(T)), sizeof(T));
    const bool big_here = std::endian::native == std::endian::big;
    if ((encoding_ == Encoding::big) != big_here) std::reverse(raw.begin(), raw.end());
    return static_cast<double>(std::bit_cast<T>(raw));
  }

  double binary(Scalar type) {
    switch (type) {
      case Scalar::i8: return take_as<std::int8_t>();
      case Scalar::u8: return take_as<std::uint8_t>();
      case Scalar::i16: return take_as<std::int16_t>();
      case Scalar::u16: return take_as<std::uint16_t>();
      case Scalar::i32: return take_as<std::int32_t>();
      case Scalar::u32: return take_as<std::uint32_t>();
      case Scalar::f32: return take_as<float>();
      case Scalar::f64: return take_as<double>();
    }
    return 0;
  }

  std::string_view bytes_;
  std::size_t byte_;
  LineReader lines_;
  std::string_view line_;
  Encoding encoding_;
  const std::filesystem::path& name_;
};

/// What we know to read from a vertex.
enum Channel { kX, kY, kZ, kNormalX, kNormalY, kNormalZ, kU, kV, kRed, kGreen, kBlue, kChannels, kOther = -1 };

int channel_of(const std::string& name) {
  static constexpr std::array<std::array<std::string_view, 4>, kChannels> kNames = {{
      {"x"}, {"y"}, {"z"}, {"nx"}, {"ny"}, {"nz"},
      {"s", "u", "texture_u", "texture_s"}, {"t", "v", "texture_v", "texture_t"},
      {"red", "r", "diffuse_red"}, {"green", "g", "diffuse_green"}, {"blue", "b", "diffuse_blue"}}};
  for (int channel = 0; channel < kChannels; ++channel) {
    const auto& names = kNames[channel];
    if (std::find(names.begin(), names.end(), name) != names.end()) return channel;
  }
  return kOther;
}

/// Colours are stored in the full range of their type.
double unit_of(Scalar type, int channel) {
  if (channel < kRed) return 1.0;
  if (type == Scalar::u8) return 1.0 / 255.0;
  return type == Scalar::u16 ? 1.0 / 65535.0 : 1.0;
}

class PlyParser {
 public:
  PlyParser(std::string_view bytes, const std::filesystem::path& name) : bytes_(bytes), name_(name), lines_(bytes) {}

  MeshAsset parse() {
    read_header();
    PlyBody body(bytes_, bytes_.size() - lines_.bytes_left(), lines_, encoding_, name_);
    asset_.primitives.emplace_back();
    for (const Element& element : elements_) {
      check_count(element.count, body.least_size(element), body.bytes_left(), body.where(),
                  "items of " + in_quotes(element.name));
      if (element.name == "vertex") {
        read_vertices(element, body);
      } else if (element.name == "face") {
        read_faces(element, body);
      } else {
        skip_element(element, body);
      }
    }
    report_what_is_left_out();
    cutter_.report(asset_);
    return std::move(asset_);
  }

 private:
  TextPlace here() const { return {name_, std::max(1L, lines_.number())}; }

  void read_header() {
    if (!lines_.next() || trimmed(lines_.line()) != "ply") here().fail("begins without the line 'ply'");
    bool has_format = false;
    while (lines_.next()) {
      std::string_view rest = lines_.line();
      const std::string_view keyword = take_word(rest);
      if (keyword == "end_header") {
        if (!has_format) here().fail("header has no 'format' line");
        return;
      }
      if (keyword == "format") {
        has_format = true;
        read_format(rest);
      } else if (keyword == "element") {
        read_element(rest);
      } else if (keyword == "property") {
        read_property(rest);
      } else if (!keyword.empty() && keyword != "comment" && keyword != "obj_info") {
        here().fail("found " + in_quotes(keyword) + "; expected 'element', 'property' or 'end_header'");
      }
    }
    here().fail("file ends inside the header; expected 'end_header'");
  }

  void read_format(std::string_view rest) {
    const std::string_view format = take_word(rest);
    if (format == "ascii") {
      encoding_ = Encoding::text;
    } else if (format == "binary_little_endian") {
      encoding_ = Encoding::little;
    } else if (format == "binary_big_endian") {
      encoding_ = Encoding::big;
    } else {
      here().fail("format " + in_quotes(format) + "; expected ascii, binary_little_endian or binary_big_endian");
    }
  }

  void read_element(std::string_view rest) {
    Element element;
    element.name = std::string(take_word(rest));
    element.count = to_integer(take_word(rest), here());
    if (element.name.empty() || element.count < 0) here().fail("expected 'element', a name and a count");
    if (element.name == "face") check_vertices_known();
    elements_.push_back(std::move(element));
  }

  /// Corners are checked as they are read, which needs the vertices before the faces.
  void check_vertices_known() {
    const auto is_vertex = [](const Element& element) { return element.name == "vertex"; };
    if (std::none_of(elements_.begin(), elements_.end(), is_vertex)) here().fail("element 'face' before 'vertex'");
  }

  void read_property(std::string_view rest) {
    if (elements_.empty()) here().fail("'property' before any 'element'");
    Property property;
    std::string_view type = take_word(rest);
    if (type == "list") {
      property.count_type = scalar_type(take_word(rest));
      if (*property.count_type >= Scalar::f32) here().fail("length of a list in floating point; expected an integer type");
      type = take_word(rest);
    }
    property.type = scalar_type(type);
    property.name = std::string(take_word(rest));
    if (property.name.empty()) here().fail("property without a name");
    elements_.back().properties.push_back(std::move(property));
  }

  Scalar scalar_type(std::string_view name) const {
    const auto type = scalar_from_name(name);
    if (!type) here().fail("type " + in_quotes(name) + "; expected char, uchar, short, ushort, int, uint, float or double");
    return *type;
  }

  void read_vertices(const Element& element, PlyBody& body) {
    if (asset_.source_positions.rows() > 0) body.fail("a second element 'vertex'");
    const std::vector<int> channels = channels_of(element);
    std::array<bool, kChannels> present{};
    for (const int channel : channels) {
      if (channel != kOther) present[channel] = true;
    }
    if (!present[kX] || !present[kY] || !present[kZ]) body.fail("element 'vertex' lacks one of x, y and z");
    const bool has_normals = present[kNormalX] && present[kNormalY] && present[kNormalZ];
    const bool has_texture = present[kU] && present[kV];
    const bool has_colours = present[kRed] && present[kGreen] && present[kBlue];
    std::vector<float> normals, textures, colours;

    asset_.source_positions.resize(element.count, 3);
    asset_.primitives.front().vertex_count = static_cast<int>(element.count);
    std::array<double, kChannels> value{};
    const auto append = [&value](std::vector<float>& to, int first, int count) {
      for (int channel = first; channel < first + count; ++channel) to.push_back(static_cast<float>(value[channel]));
    };
    for (std::int64_t vertex = 0; vertex < element.count; ++vertex) {
      body.begin_item(element, vertex);
      for (std::size_t i = 0; i < channels.size(); ++i) {
        const Property& property = element.properties[i];
        if (channels[i] == kOther) {
          body.skip(property);
        } else {
          value[channels[i]] = body.number(property.type) * unit_of(property.type, channels[i]);
        }
      }
      body.end_item();
      asset_.source_positions.row(vertex) << value[kX], value[kY], value[kZ];
      if (has_normals) append(normals, kNormalX, 3);
      if (has_texture) append(textures, kU, 2);
      if (has_colours) append(colours, kRed, 3);
    }
    auto& attributes = asset_.primitives.front().attributes;
    if (has_normals) attributes.push_back(unit_normals(std::move(normals), asset_));
    if (has_texture) attributes.push_back(texture_coordinates(std::move(textures)));
    if (has_colours) attributes.push_back(linear_colours(std::move(colours)));
  }

  std::vector<int> channels_of(const Element& element) {
    std::vector<int> channels;
    for (const Property& property : element.properties) {
      channels.push_back(property.count_type ? kOther : channel_of(property.name));
      if (channels.back() == kOther && property.name != "alpha") note_left_out("vertex." + property.name);
    }
    return channels;
  }

  void read_faces(const Element& element, PlyBody& body) {
    const auto is_corners = [](const Property& property) {
      return property.count_type && property.type < Scalar::f32 &&
             (property.name == "vertex_indices" || property.name == "vertex_index");
    };
    const auto& properties = element.properties;
    if (std::count_if(properties.begin(), properties.end(), is_corners) != 1) {
      body.fail("element 'face' has no integer list 'vertex_indices'");
    }
    for (const Property& property : properties) {
      if (!is_corners(property)) note_left_out("face." + property.name);
    }
    for (std::int64_t face = 0; face < element.count; ++face) {
      body.begin_item(element, face);
      for (const Property& property : properties) {
        if (is_corners(property)) {
          read_corners(property, body);
        } else {
          body.skip(property);
        }
      }
      body.end_item();
    }
  }

  void read_corners(const Property& property, PlyBody& body) {
    const std::int64_t count = body.list_length(property);
    corners_.clear();
    for (std::int64_t i = 0; i < count; ++i) {
      const std::int64_t vertex = body.integer(property.type);
      if (vertex < 0 || vertex >= asset_.source_positions.rows()) {
        body.fail("vertex index " + std::to_string(vertex) + "; the file has " +
                  counted(asset_.source_positions.rows(), "vertex", "vertices") + ", counted from 0");
      }
      corners_.push_back(static_cast<int>(vertex));
    }
    written_.assign(corners_.begin(), corners_.end());
    cutter_.cut(corners_, asset_.source_positions, written_, asset_.primitives.front().indices);
  }

  void skip_element(const Element& element, PlyBody& body) {
    if (element.name == "tristrips") {
      throw FileError(FileFault::unusable, body.where(), "triangle strips are not read; save the mesh as faces");
    }
    note_left_out(element.name);
    if (element.properties.empty()) return;
    for (std::int64_t item = 0; item < element.count; ++item) {
      body.begin_item(element, item);
      for (const Property& property : element.properties) body.skip(property);
      body.end_item();
    }
  }

  void note_left_out(const std::string& name) { left_out_ += (left_out_.empty() ? "" : ", ") + in_quotes(name); }

  void report_what_is_left_out() {
    constexpr std::size_t kReadable = 200;
    if (left_out_.empty()) return;
    if (left_out_.size() > kReadable) left_out_ = left_out_.substr(0, kReadable) + "...";
    asset_.warnings.push_back("W_PLY_LEFT_OUT: not carried: " + left_out_);
  }

  std::string_view bytes_;
  const std::filesystem::path& name_;
  LineReader lines_;
  Encoding encoding_ = Encoding::text;
  std::vector<Element> elements_;
  std::string left_out_;  ///< what the file has and we do not carry
  std::vector<int> corners_;
  std::vector<std::uint32_t> written_;
  PolygonCutter cutter_;
  MeshAsset asset_;
};

}  // namespace

MeshAsset parse_ply(std::string_view bytes, const std::filesystem::path& name) {
  return PlyParser(bytes, name).parse();
}

}  // namespace sinew
