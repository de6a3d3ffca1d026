// Object File Format, as the Geomview manual describes it (OFF, section 4.2.5 of its formats chapter).
#include <string>

#include "io/file_error.h"
#include "io/mesh_reader.h"
#include "io/text_scanner.h"

namespace sinew {
namespace {

struct OffHeader {
  bool texture = false;  // ST
  bool colour = false;   // C
  bool normal = false;   // N
};

class OffParser {
 public:
  OffParser(std::string_view text, const std::filesystem::path& name) : lines_(text), name_(name) {}

  MeshAsset parse() {
    read_header();
    read_counts();
    read_vertices();
    read_faces();
    add_attributes();
    cutter_.report(asset_);
    return std::move(asset_);
  }

 private:
  TextPlace here() const { return {name_, lines_.number()}; }

  /// The next line that says something, comments cut off; false at the end of the file.
  bool next_line() {
    while (lines_.next()) {
      line_ = trimmed(lines_.line().substr(0, lines_.line().find('#')));
      if (!line_.empty()) return true;
    }
    return false;
  }

  void read_header() {
    if (!next_line()) TextPlace{name_, 1}.fail("file is empty; expected OFF");
    const std::string_view whole = take_word(line_);
    std::string_view word = whole;
    const auto take = [&word](std::string_view prefix) {
      const bool found = word.starts_with(prefix);
      if (found) word.remove_prefix(prefix.size());
      return found;
    };
    header_.texture = take("ST");
    header_.colour = take("C");
    header_.normal = take("N");
    if (take("4") || take("n")) {
      throw FileError(FileFault::unusable, name_.string(), in_quotes(whole) + " is not three-dimensional");
    }
    if (word != "OFF") here().fail("begins with " + in_quotes(whole) + "; expected OFF");
    std::string_view rest = line_;
    if (take_word(rest) == "BINARY") {
      throw FileError(FileFault::unusable, name_.string(), "is a binary OFF file, which is not read; save it as text");
    }
  }

  void read_counts() {
    if (trimmed(line_).empty() && !next_line()) here().fail("file ends before the counts of vertices and faces");
    const std::int64_t vertices = to_integer(take_word(line_), here());
    const std::int64_t faces = to_integer(take_word(line_), here());
    if (vertices < 0 || faces < 0) here().fail("negative count; expected the numbers of vertices and faces");
    const std::string where = name_.string() + ":" + std::to_string(lines_.number());
    check_count(vertices, 5, lines_.bytes_left(), where, "vertices");  // "0 0 0"
    check_count(faces, 1, lines_.bytes_left(), where, "faces");        // "0"
    vertex_count_ = static_cast<int>(vertices);
    face_count_ = static_cast<int>(faces);
  }

  float take_float() { return static_cast<float>(to_number(take_word(line_), here())); }

  void read_vertices() {
    asset_.source_positions.resize(vertex_count_, 3);
    for (int vertex = 0; vertex < vertex_count_; ++vertex) {
      if (!next_line()) {
        here().fail("file ends after " + std::to_string(vertex) + " of " + counted(vertex_count_, "vertex", "vertices"));
      }
      const int words = count_words(line_);
      const int expected = 3 + 3 * header_.normal + 3 * header_.colour + 2 * header_.texture;
      if (words < expected) {
        here().fail("vertex has " + counted(words, "value", "values") + "; expected " + std::to_string(expected));
      }
      for (int axis = 0; axis < 3; ++axis) asset_.source_positions(vertex, axis) = to_number(take_word(line_), here());
      if (header_.normal) append(normals_, 3);
      if (header_.colour) append(colours_, 3);
      // A colour may have a fourth number, its alpha.
      if (header_.colour && count_words(line_) % 2 == 1) take_word(line_);
      if (header_.texture) append(textures_, 2);
      check_rest(words);
    }
    if (unannounced_ > 0) {
      asset_.warnings.push_back("W_OFF_COLOURS: " + counted(unannounced_, "colour", "colours") +
                                " not read because the file does not begin with COFF");
    }
  }

  /// Some programs write colours in files that do not announce them.
  void check_rest(int words) {
    const int rest = count_words(line_);
    const bool colour = !header_.colour && (rest == 3 || rest == 4);
    if (rest > 0 && !colour) here().fail("vertex has " + std::to_string(words) + " values; expected " + std::to_string(words - rest));
    unannounced_ += colour;
  }

  void append(std::vector<float>& values, int count) {
    for (int i = 0; i < count; ++i) values.push_back(take_float());
  }

  void read_faces() {
    SourcePrimitive primitive;
    primitive.vertex_count = vertex_count_;
    std::vector<int> corners;
    for (int face = 0; face < face_count_; ++face) {
      if (!next_line()) {
        here().fail("file ends after " + std::to_string(face) + " of " + counted(face_count_, "face", "faces"));
      }
      read_corners(corners);
      written_.assign(corners.begin(), corners.end());
      cutter_.cut(corners, asset_.source_positions, written_, primitive.indices);
    }
    asset_.primitives.push_back(std::move(primitive));
  }

  /// What follows the corners is the colour of the face, which is not carried.
  void read_corners(std::vector<int>& corners) {
    const std::int64_t count = to_integer(take_word(line_), here());
    const int found = count_words(line_);
    if (count < 0 || count > found) {
      here().fail("face announces " + std::to_string(count) + " corners and has " + std::to_string(found));
    }
    corners.clear();
    for (std::int64_t i = 0; i < count; ++i) {
      const std::int64_t vertex = to_integer(take_word(line_), here());
      if (vertex < 0 || vertex >= vertex_count_) {
        here().fail("vertex index " + std::to_string(vertex) + "; the file has " +
                    counted(vertex_count_, "vertex", "vertices") + ", counted from 0");
      }
      corners.push_back(static_cast<int>(vertex));
    }
  }

  void add_attributes() {
    auto& attributes = asset_.primitives.front().attributes;
    if (header_.normal) attributes.push_back(unit_normals(std::move(normals_), asset_));
    if (header_.texture) attributes.push_back(texture_coordinates(std::move(textures_)));
    if (header_.colour) attributes.push_back(linear_colours(std::move(colours_)));
  }

  LineReader lines_;
  const std::filesystem::path& name_;
  std::string_view line_;
  OffHeader header_;
  int vertex_count_ = 0;
  int face_count_ = 0;
  std::int64_t unannounced_ = 0;  // colours
  std::vector<float> normals_, colours_, textures_;
  std::vector<std::uint32_t> written_;
  PolygonCutter cutter_;
  MeshAsset asset_;
};

}  // namespace

MeshAsset parse_off(std::string_view bytes, const std::filesystem::path& name) {
  return OffParser(bytes, name).parse();
}

}  // namespace sinew
