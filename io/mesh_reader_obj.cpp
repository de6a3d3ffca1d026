// Wavefront OBJ, after appendix B1 of the Advanced Visualizer manual: what it says of vertices, faces and
// groups.
#include <algorithm>
#include <cstring>
#include <map>
#include <string>

#include "io/file_error.h"
#include "io/mesh_reader.h"
#include "io/text_scanner.h"

namespace sinew {
namespace {

constexpr int kNone = -1;

/// More groups than this are read as one: a file that names each face would drown in primitives.
constexpr std::size_t kMostGroups = 4096;

/// Indices from 0 into the lists of v, vt and vn; kNone where the face gives none.
struct Corner {
  int vertex = kNone;
  int texture = kNone;
  int normal = kNone;
  auto operator<=>(const Corner&) const = default;
};

struct Group {
  std::string name;
  std::vector<Corner> corners;  ///< of all its faces, one after the other
  std::vector<int> face_sizes;
};

/// A list that faces point into: how long it is, and the farthest that any face has pointed.
struct IndexedList {
  const char* item;
  std::int64_t count = 0;
  std::int64_t farthest = 0;
  long farthest_line = 0;
};

/// Everything an OBJ file says, before corners become vertices.
struct ObjText {
  std::vector<Eigen::Vector3d> positions;
  std::vector<float> colours;   ///< three to a position, or none at all
  std::vector<float> textures;  ///< two to a vt
  std::vector<float> normals;   ///< three to a vn
  std::vector<Group> groups;
  std::vector<std::string> warnings;
};

class ObjParser {
 public:
  ObjParser(std::string_view text, const std::filesystem::path& name) : lines_(text), name_(name) {}

  ObjText parse() {
    while (next_statement()) {
      std::string_view rest = statement_;
      const std::string_view keyword = take_word(rest);
      if (!keyword.empty()) read_statement(keyword, rest);
    }
    for (const IndexedList& list : {vertices_, textures_, normals_}) check_farthest(list);
    report();
    return std::move(obj_);
  }

 private:
  TextPlace here() const { return {name_, line_}; }

  /// A line without its comment, joined with the next ones where it ends in a backslash.
  bool next_statement() {
    if (!lines_.next()) return false;
    line_ = lines_.number();
    statement_ = without_comment(lines_.line());
    if (!trimmed(statement_).ends_with('\\')) return true;
    joined_.clear();
    do {
      const std::string_view part = trimmed(without_comment(lines_.line()));
      joined_ += part.substr(0, part.size() - part.ends_with('\\'));
      joined_ += ' ';
      if (!part.ends_with('\\')) break;
    } while (lines_.next());
    statement_ = joined_;
    return true;
  }

  /// A comment begins like a word: 1.#QNAN, and a name with # in it, are none.
  static std::string_view without_comment(std::string_view line) {
    std::size_t at = line.find('#');
    while (at != line.npos && at > 0 && line[at - 1] != ' ' && line[at - 1] != '\t') at = line.find('#', at + 1);
    return line.substr(0, at);
  }

  void read_statement(std::string_view keyword, std::string_view rest) {
    if (keyword == "v") return read_vertex(rest);
    if (keyword == "vt") return read_numbers("vt", rest, 1, 3, 2, obj_.textures, textures_);
    if (keyword == "vn") return read_numbers("vn", rest, 3, 3, 3, obj_.normals, normals_);
    if (keyword == "f" || keyword == "fo") return read_face(rest);
    if (keyword == "s") return;     // smoothing: normals say it better, and positions do not care
    if (keyword == "\x1A") return;  // how DOS ends a file
    if (keyword == "o") {
      object_ = printable_name(rest);
      group_.clear();
    } else if (keyword == "g") {
      group_ = printable_name(rest);
    } else if (keyword == "usemtl") {
      material_ = printable_name(rest);
    } else if (keyword == "mtllib") {
      has_materials_ = true;
    } else {
      if (unknown_++ == 0) first_unknown_ = in_quotes(keyword) + " at line " + std::to_string(line_);
      return;
    }
    current_ = nullptr;
  }

  void read_vertex(std::string_view rest) {
    // x y z, then perhaps w, or red green blue, or red green blue alpha.
    const int words = count_words(rest);
    if (words != 3 && words != 4 && words != 6 && words != 7) {
      here().fail("v has " + counted(words, "value", "values") + "; expected 3, 4, 6 or 7");
    }
    Eigen::Vector3d position;
    for (double& value : position) value = to_number(take_word(rest), here());
    obj_.positions.push_back(position);
    ++vertices_.count;
    if (words < 6 && obj_.colours.empty()) return;
    obj_.colours.resize(3 * (obj_.positions.size() - 1), 1.0F);  // white before the first coloured one
    for (int i = 0; i < 3; ++i) {
      obj_.colours.push_back(words < 6 ? 1.0F : static_cast<float>(to_number(take_word(rest), here())));
    }
  }

  /// Keeps the first `kept` of `least` to `most` numbers, zeros standing for those that are not given.
  void read_numbers(const char* keyword, std::string_view rest, int least, int most, int kept,
                    std::vector<float>& values, IndexedList& list) {
    const int words = count_words(rest);
    if (words < least || words > most) {
      here().fail(std::string(keyword) + " has " + counted(words, "value", "values") + "; expected " +
                  std::to_string(least) + (most > least ? " to " + std::to_string(most) : ""));
    }
    for (int i = 0; i < kept; ++i) {
      values.push_back(i < words ? static_cast<float>(to_number(take_word(rest), here())) : 0.0F);
    }
    ++list.count;
  }

  void read_face(std::string_view rest) {
    Group& group = current_group();
    int size = 0;
    for (std::string_view word = take_word(rest); !word.empty(); word = take_word(rest)) {
      group.corners.push_back(to_corner(word));
      ++size;
    }
    if (size == 0) here().fail("f has no corners; expected 3 or more");
    group.face_sizes.push_back(size);
  }

  /// "7", "7/3", "7//2" or "7/3/2".
  Corner to_corner(std::string_view word) {
    const auto take_part = [&word] {
      const std::size_t slash = std::min(word.find('/'), word.size());
      const std::string_view part = word.substr(0, slash);
      word.remove_prefix(std::min(word.size(), slash + 1));
      return part;
    };
    const std::string_view whole = word;
    const std::string_view vertex = take_part();
    const std::string_view texture = take_part();
    const std::string_view normal = take_part();
    if (vertex.empty() || !word.empty()) here().fail("corner " + in_quotes(whole) + "; expected v, v/vt, v//vn or v/vt/vn");
    return {.vertex = to_index(vertex, vertices_),
            .texture = texture.empty() ? kNone : to_index(texture, textures_),
            .normal = normal.empty() ? kNone : to_index(normal, normals_)};
  }

  /// Counted from 1 from the beginning, or from -1 backwards. What points ahead may still come.
  int to_index(std::string_view word, IndexedList& list) {
    const std::int64_t written = to_integer(word, here());
    if (written == 0) here().fail(std::string(list.item) + " index 0; OBJ counts from 1");
    const std::int64_t index = written > 0 ? written : list.count + 1 + written;
    if (index < 1 || index > 2'147'483'647) {
      here().fail(std::string(list.item) + " index " + std::to_string(written) + "; the file has " +
                  std::to_string(list.count) + " so far");
    }
    if (index > list.farthest) {
      list.farthest = index;
      list.farthest_line = line_;
    }
    return static_cast<int>(index - 1);
  }

  void check_farthest(const IndexedList& list) const {
    if (list.farthest <= list.count) return;
    throw FileError(name_, list.farthest_line,
                    std::string(list.item) + " index " + std::to_string(list.farthest) + "; the file has " +
                        std::to_string(list.count));
  }

  /// The group that the names now in force make, begun by its first face.
  Group& current_group() {
    if (current_) return *current_;
    auto found = group_of_names_.find({object_, group_, material_});
    if (found == group_of_names_.end() && obj_.groups.size() >= kMostGroups) {
      too_many_groups_ = true;
      return obj_.groups.front();
    }
    if (found == group_of_names_.end()) {
      found = group_of_names_.emplace(std::array{object_, group_, material_}, obj_.groups.size()).first;
      obj_.groups.push_back({.name = !group_.empty() ? group_ : !object_.empty() ? object_ : material_,
                             .corners = {}, .face_sizes = {}});
    }
    current_ = &obj_.groups[found->second];
    return *current_;
  }

  void report() {
    if (too_many_groups_) merge_groups();
    if (has_materials_) obj_.warnings.push_back("W_OBJ_MATERIALS: materials are not carried from OBJ files");
    if (unknown_ == 0) return;
    if (obj_.positions.empty() && obj_.groups.empty()) {
      throw FileError(FileFault::malformed, name_.string(), "is not an OBJ file: no line begins with 'v' or 'f'");
    }
    obj_.warnings.push_back("W_OBJ_UNKNOWN: " + counted(unknown_, "line", "lines") +
                            " of kinds that are not read, the first " + first_unknown_);
  }

  void merge_groups() {
    Group& all = obj_.groups.front();
    for (std::size_t i = 1; i < obj_.groups.size(); ++i) {
      const Group& group = obj_.groups[i];
      all.corners.insert(all.corners.end(), group.corners.begin(), group.corners.end());
      all.face_sizes.insert(all.face_sizes.end(), group.face_sizes.begin(), group.face_sizes.end());
    }
    all.name.clear();
    obj_.groups.resize(1);
    obj_.warnings.push_back("W_OBJ_GROUPS: more than " + std::to_string(kMostGroups) + " groups read as one");
  }

  LineReader lines_;
  const std::filesystem::path& name_;
  long line_ = 0;               // where the statement begins
  std::string_view statement_;  // of lines_ or of joined_
  std::string joined_;
  IndexedList vertices_{"vertex"}, textures_{"texture"}, normals_{"normal"};
  std::string object_, group_, material_;
  std::map<std::array<std::string, 3>, std::size_t> group_of_names_;
  Group* current_ = nullptr;  // null after a change of name; vectors of groups move when they grow
  bool too_many_groups_ = false;
  bool has_materials_ = false;
  std::int64_t unknown_ = 0;
  std::string first_unknown_;
  ObjText obj_;
};

/// Turns groups into primitives: each (v, vt, vn) that occurs becomes a vertex.
class PrimitiveBuilder {
 public:
  explicit PrimitiveBuilder(const ObjText& obj)
      : obj_(obj), row_of_vertex_(obj.positions.size(), kNone), first_corner_(obj.positions.size()) {
    const auto rows = static_cast<Eigen::Index>(obj.positions.size());
    positions_.resize(rows, 3);
    for (Eigen::Index row = 0; row < rows; ++row) positions_.row(row) = obj.positions[row].transpose();
    asset_.warnings = obj.warnings;
  }

  MeshAsset build() {
    find_unreferenced();
    for (const Group& group : obj_.groups) add_primitive(group);
    if (obj_.groups.empty()) add_vertices(unreferenced_);
    copy_positions();
    cutter_.report(asset_);
    return std::move(asset_);
  }

 private:
  void find_unreferenced() {
    std::vector<bool> used(obj_.positions.size());
    for (const Group& group : obj_.groups) {
      for (const Corner& corner : group.corners) used[corner.vertex] = true;
    }
    for (std::size_t vertex = 0; vertex < used.size(); ++vertex) {
      if (!used[vertex]) unreferenced_.push_back(static_cast<int>(vertex));
    }
  }

  void add_primitive(const Group& group) {
    SourcePrimitive primitive;
    primitive.name = group.name;
    primitive.first_vertex = static_cast<int>(corner_of_row_.size());
    std::vector<int> vertices = asset_.primitives.empty() ? unreferenced_ : std::vector<int>{};
    for (const Corner& corner : group.corners) vertices.push_back(corner.vertex);
    std::sort(vertices.begin(), vertices.end());
    vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());

    add_vertices(vertices);
    const std::vector<int> rows = rows_of_corners(group.corners);
    primitive.vertex_count = static_cast<int>(corner_of_row_.size()) - primitive.first_vertex;
    cut_faces(group, rows, primitive);
    add_attributes(primitive);
    asset_.primitives.push_back(std::move(primitive));
    for (const int vertex : vertices) row_of_vertex_[vertex] = kNone;
  }

  /// A row for each vertex, in the order given. Its texture coordinate and normal are still open.
  void add_vertices(const std::vector<int>& vertices) {
    for (const int vertex : vertices) {
      row_of_vertex_[vertex] = static_cast<int>(corner_of_row_.size());
      first_corner_[vertex] = {};
      corner_of_row_.push_back({.vertex = vertex, .texture = kNone, .normal = kNone});
    }
  }

  /// The row of each corner; a vertex's own row goes to the first pair it is met with, and every further
  /// pair gets a copy, in the order in which they are met.
  std::vector<int> rows_of_corners(const std::vector<Corner>& corners) {
    std::vector<int> rows(corners.size());
    std::vector<int> others;  // corners that need a copy
    for (std::size_t i = 0; i < corners.size(); ++i) {
      const Corner& corner = corners[i];
      rows[i] = row_of_vertex_[corner.vertex];
      Corner& first = first_corner_[corner.vertex];
      if (first.vertex == kNone) first = corner_of_row_[rows[i]] = corner;
      if (first != corner) others.push_back(static_cast<int>(i));
    }
    // Equal corners side by side, the earliest leading; the leaders, in order of appearance, are the copies.
    std::vector<int> sorted = others;
    std::stable_sort(sorted.begin(), sorted.end(), [&](int a, int b) { return corners[a] < corners[b]; });
    std::vector<int> leader(corners.empty() || others.empty() ? 0 : corners.size());
    for (std::size_t i = 0; i < sorted.size(); ++i) {
      const bool same = i > 0 && corners[sorted[i]] == corners[sorted[i - 1]];
      leader[sorted[i]] = same ? leader[sorted[i - 1]] : sorted[i];
    }
    for (const int i : others) {
      if (leader[i] != i) {
        rows[i] = rows[leader[i]];
        continue;
      }
      rows[i] = static_cast<int>(corner_of_row_.size());
      corner_of_row_.push_back(corners[i]);
    }
    return rows;
  }

  void cut_faces(const Group& group, const std::vector<int>& rows, SourcePrimitive& primitive) {
    std::size_t begin = 0;
    std::vector<int> vertices;
    std::vector<std::uint32_t> written;
    for (const int size : group.face_sizes) {
      vertices.clear();
      written.clear();
      for (std::size_t i = begin; i < begin + size; ++i) {
        vertices.push_back(group.corners[i].vertex);
        written.push_back(static_cast<std::uint32_t>(rows[i] - primitive.first_vertex));
      }
      cutter_.cut(vertices, positions_, written, primitive.indices);
      begin += size;
    }
  }

  /// Texture coordinates where any corner has them, zeros elsewhere. Normals only where all corners have
  /// them: there is no harmless normal to stand in.
  void add_attributes(SourcePrimitive& primitive) {
    const auto begin = corner_of_row_.begin() + primitive.first_vertex;
    const auto end = corner_of_row_.end();
    // A row that no face uses has neither, and does not count.
    const auto used = [this](const Corner& corner) { return first_corner_[corner.vertex].vertex != kNone; };
    const auto has_texture = [](const Corner& corner) { return corner.texture != kNone; };
    const auto has_normal = [](const Corner& corner) { return corner.normal != kNone; };
    const bool any_normal = std::any_of(begin, end, has_normal);
    const bool all_normals = std::all_of(begin, end, [&](const Corner& c) { return has_normal(c) || !used(c); });
    if (any_normal && all_normals) {
      std::vector<float> normals;
      for (auto corner = begin; corner != end; ++corner) append(normals, obj_.normals, corner->normal, {0, 0, 1});
      primitive.attributes.push_back(unit_normals(std::move(normals), asset_));
    } else if (any_normal) {
      asset_.warnings.push_back("W_OBJ_NORMALS: normals of " + in_quotes(primitive.name) +
                                " left out because some corners have none");
    }
    if (std::any_of(begin, end, has_texture)) {
      std::vector<float> textures;
      for (auto corner = begin; corner != end; ++corner) append(textures, obj_.textures, corner->texture, {0, 0});
      primitive.attributes.push_back(texture_coordinates(std::move(textures)));
    }
    if (!obj_.colours.empty()) {
      std::vector<float> colours;
      for (auto corner = begin; corner != end; ++corner) append(colours, obj_.colours, corner->vertex, {1, 1, 1});
      primitive.attributes.push_back(linear_colours(std::move(colours)));
    }
  }

  static void append(std::vector<float>& to, const std::vector<float>& from, int item, std::initializer_list<float> none) {
    if (item == kNone) {
      to.insert(to.end(), none);
    } else {
      const auto begin = from.begin() + static_cast<std::ptrdiff_t>(item * none.size());
      to.insert(to.end(), begin, begin + static_cast<std::ptrdiff_t>(none.size()));
    }
  }

  void copy_positions() {
    const auto rows = static_cast<Eigen::Index>(corner_of_row_.size());
    asset_.source_positions.resize(rows, 3);
    for (Eigen::Index row = 0; row < rows; ++row) {
      const int vertex = corner_of_row_[row].vertex;
      asset_.source_positions.row(row) = positions_.row(vertex);
      asset_.file_vertex_of_row.push_back(vertex);
    }
  }

  const ObjText& obj_;
  Field3 positions_;                   // of v
  std::vector<int> unreferenced_;      // v that no face uses
  std::vector<int> row_of_vertex_;     // v -> its own row in the primitive being built
  std::vector<Corner> first_corner_;   // v -> the corner that has taken that row
  std::vector<Corner> corner_of_row_;  // row -> what it is made of
  PolygonCutter cutter_;
  MeshAsset asset_;
};

}  // namespace

MeshAsset parse_obj(std::string_view bytes, const std::filesystem::path& name) {
  const ObjText obj = ObjParser(bytes, name).parse();
  return PrimitiveBuilder(obj).build();
}

}  // namespace sinew
