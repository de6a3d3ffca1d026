// The only file that includes toml++.
#include "io/rig_file.h"

#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <map>
#include <optional>
#include <stdexcept>

#include "io/atomic_file.h"
#include "io/file_error.h"
#include "io/text_scanner.h"

namespace sinew {
namespace {

constexpr std::string_view kSchema = "sinew.rig/1";
constexpr std::array<std::string_view, 6> kAxes = {"+x", "-x", "+y", "-y", "+z", "-z"};

Eigen::Vector3d axis(std::size_t which) {
  return (which % 2 == 0 ? 1.0 : -1.0) * Eigen::Vector3d::Unit(static_cast<Eigen::Index>(which / 2));
}

std::string known_roles() {
  std::string names;
  for (int role = 0; role < kRoleCount; ++role) {
    names += (role > 0 ? ", " : "") + std::string(role_name(static_cast<Role>(role)));
  }
  return names;
}

class RigReader {
 public:
  explicit RigReader(const std::filesystem::path& file) : file_(file) {}

  RigSkeleton read(const toml::table& root) {
    check_schema(root);
    check_keys(root, {"schema", "mesh", "up", "front", "joint", "map"});
    if (root.contains("mesh")) rig_.mesh = text(root, "mesh");
    if (const toml::node* up = root.get("up")) rig_.up = direction(*up, "up");
    if (const toml::node* front = root.get("front")) rig_.front = direction(*front, "front");
    if (rig_.up.stableNormalized().cross(rig_.front.stableNormalized()).norm() < 1e-6) {
      fail(root.contains("front") ? *root.get("front") : root, "up and front are parallel");
    }
    read_joints(root);
    find_parents();
    sort_joints();
    read_map(root);
    return std::move(rig_);
  }

 private:
  [[noreturn]] void fail_at(const toml::source_region& place, const std::string& what) const {
    throw FileError(file_, std::max<long>(1, place.begin.line), what);
  }
  [[noreturn]] void fail(const toml::node& node, const std::string& what) const { fail_at(node.source(), what); }

  /// First of all: a file of another schema has other keys.
  void check_schema(const toml::table& root) const {
    if (!root.contains("schema")) fail(root, "key 'schema' is missing; expected schema = \"" + std::string(kSchema) + "\"");
    const std::string schema = text(root, "schema");
    if (schema != kSchema) fail(*root.get("schema"), "schema " + in_quotes(schema) + "; expected '" + std::string(kSchema) + "'");
  }

  void check_keys(const toml::table& table, std::initializer_list<std::string_view> known) const {
    for (const auto& [key, value] : table) {
      if (std::find(known.begin(), known.end(), key.str()) != known.end()) continue;
      std::string names;
      for (const std::string_view name : known) names += (names.empty() ? "" : ", ") + std::string(name);
      fail_at(key.source(), "unknown key " + in_quotes(key.str()) + "; expected one of " + names);
    }
  }

  const toml::node& required(const toml::table& table, std::string_view key) const {
    const toml::node* node = table.get(key);
    if (!node) fail(table, "key '" + std::string(key) + "' is missing");
    return *node;
  }

  std::string text(const toml::table& table, std::string_view key) const {
    const toml::node& node = required(table, key);
    const auto* value = node.as_string();
    if (!value || value->get().empty()) fail(node, std::string(key) + " is not text in quotes");
    return value->get();
  }

  double number(const toml::node& node, const std::string& what) const {
    const std::optional<double> value = node.is_number() ? node.value<double>() : std::nullopt;
    if (!value || !std::isfinite(*value)) fail(node, what + " is not a finite number");
    return *value;
  }

  Eigen::Vector3d point(const toml::node& node, const std::string& what) const {
    const toml::array* values = node.as_array();
    if (!values || values->size() != 3) fail(node, what + " is not three numbers [x, y, z]");
    Eigen::Vector3d result;
    for (std::size_t i = 0; i < 3; ++i) result[static_cast<Eigen::Index>(i)] = number(*values->get(i), what);
    return result;
  }

  Eigen::Vector3d direction(const toml::node& node, const std::string& what) const {
    if (const auto* name = node.as_string()) {
      const auto found = std::find(kAxes.begin(), kAxes.end(), name->get());
      if (found == kAxes.end()) fail(node, what + " is " + in_quotes(name->get()) + "; expected +x, -x, +y, -y, +z, -z or [x, y, z]");
      return axis(static_cast<std::size_t>(found - kAxes.begin()));
    }
    const Eigen::Vector3d vector = point(node, what);
    if (vector.isZero(0)) fail(node, what + " has no length");
    return vector;
  }

  std::optional<double> radius(const toml::table& table, std::string_view key) const {
    const toml::node* node = table.get(key);
    if (!node) return std::nullopt;
    const double value = number(*node, std::string(key));
    if (value <= 0) fail(*node, std::string(key) + " is not positive");
    return value;
  }

  void read_joints(const toml::table& root) {
    const toml::node* node = root.get("joint");
    if (!node) fail(root, "there is no [[joint]]; a rig needs one or more");
    const toml::array* joints = node->as_array();
    if (!joints || joints->empty()) fail(*node, "joint is not a list of tables; expected [[joint]]");
    for (const toml::node& item : *joints) {
      if (!item.is_table()) fail(item, "joint is not a table; expected [[joint]]");
      read_joint(*item.as_table());
    }
  }

  void read_joint(const toml::table& table) {
    check_keys(table, {"name", "parent", "role", "position", "tip", "cylinder_radius", "sphere_radius", "helpers"});
    RigJoint joint;
    joint.name = text(table, "name");
    if (!joint_of_name_.emplace(joint.name, rig_.joint_count()).second) {
      fail(*table.get("name"), "a second joint named " + in_quotes(joint.name));
    }
    joint.position = point(required(table, "position"), "position");
    if (table.contains("role")) joint.role = role(table);
    if (const toml::node* tip = table.get("tip")) joint.tip = point(*tip, "tip");
    joint.cylinder_radius = radius(table, "cylinder_radius");
    joint.sphere_radius = radius(table, "sphere_radius");
    if (const toml::node* helpers = table.get("helpers")) joint.helpers = segments(*helpers);
    rig_.joints.push_back(std::move(joint));
    tables_.push_back(&table);
  }

  Role role(const toml::table& table) {
    const std::string name = text(table, "role");
    const std::optional<Role> found = role_from_name(name);
    if (!found) fail(*table.get("role"), "unknown role " + in_quotes(name) + "; expected one of " + known_roles());
    for (const RigJoint& other : rig_.joints) {
      if (other.role != found) continue;
      fail(*table.get("role"), "a second joint with role " + in_quotes(name) + "; " + in_quotes(other.name) + " has it");
    }
    return *found;
  }

  std::vector<Segment> segments(const toml::node& node) const {
    const std::string expected = "helpers is not a list of { from = [x, y, z], to = [x, y, z] }";
    const toml::array* items = node.as_array();
    if (!items) fail(node, expected);
    std::vector<Segment> result;
    for (const toml::node& item : *items) {
      const toml::table* table = item.as_table();
      if (!table) fail(item, expected);
      check_keys(*table, {"from", "to"});
      result.push_back({point(required(*table, "from"), "from"), point(required(*table, "to"), "to")});
    }
    return result;
  }

  void find_parents() {
    for (std::size_t joint = 0; joint < rig_.joints.size(); ++joint) {
      const toml::table& table = *tables_[joint];
      if (!table.contains("parent")) continue;
      const std::string name = text(table, "parent");
      const auto found = joint_of_name_.find(name);
      if (found == joint_of_name_.end()) {
        fail(*table.get("parent"), "unknown parent " + in_quotes(name) + "; no joint has that name");
      }
      rig_.joints[joint].parent = found->second;
    }
  }

  /// Parents before children, otherwise in the file's order.
  void sort_joints() {
    enum State : char { unseen, above, placed };
    std::vector<State> state(rig_.joints.size(), unseen);
    std::vector<int> place(rig_.joints.size());
    std::vector<RigJoint> sorted;
    for (int joint = 0; joint < rig_.joint_count(); ++joint) {
      std::vector<int> chain;  // from the joint up to the first ancestor that is placed
      for (int i = joint; i >= 0 && state[i] != placed; i = rig_.joints[i].parent) {
        if (state[i] == above) fail(*tables_[i], "joint " + in_quotes(rig_.joints[i].name) + " is its own ancestor");
        state[i] = above;
        chain.push_back(i);
      }
      for (auto i = chain.rbegin(); i != chain.rend(); ++i) {
        state[*i] = placed;
        place[*i] = static_cast<int>(sorted.size());
        RigJoint& next = sorted.emplace_back(std::move(rig_.joints[*i]));
        if (next.parent >= 0) next.parent = place[next.parent];
      }
    }
    rig_.joints = std::move(sorted);
  }

  void read_map(const toml::table& root) {
    const toml::node* node = root.get("map");
    if (!node) return;
    const toml::table* map = node->as_table();
    if (!map) fail(*node, "map is not a table; expected [map]");
    std::vector<const toml::key*> keys;  // toml++ sorts them by name
    for (const auto& [key, value] : *map) keys.push_back(&key);
    std::sort(keys.begin(), keys.end(), [](const toml::key* a, const toml::key* b) {
      const auto place = [](const toml::key* key) { return std::pair(key->source().begin.line, key->source().begin.column); };
      return place(a) < place(b);
    });
    for (const toml::key* key : keys) {
      if (!joint_of_name_.count(std::string(key->str()))) {
        fail_at(key->source(), "map names " + in_quotes(key->str()) + ", which is no joint of the rig");
      }
      rig_.map.emplace_back(key->str(), text(*map, key->str()));
    }
  }

  const std::filesystem::path& file_;
  RigSkeleton rig_;
  std::vector<const toml::table*> tables_;      // of the joints, in the file's order
  std::map<std::string, int> joint_of_name_;    // in the file's order
};

std::string number_text(double value) {
  char digits[32];
  std::string text(digits, std::to_chars(digits, digits + sizeof digits, value).ptr);
  // Without a point TOML reads an integer, which has no -0 and ends at 2^63.
  if (text.find_first_of(".e") == text.npos) text += ".0";
  return text;
}

std::string point_text(const Eigen::Vector3d& point) {
  return "[" + number_text(point.x()) + ", " + number_text(point.y()) + ", " + number_text(point.z()) + "]";
}

std::string direction_text(const Eigen::Vector3d& direction) {
  for (std::size_t which = 0; which < kAxes.size(); ++which) {
    if (direction == axis(which)) return "\"" + std::string(kAxes[which]) + "\"";
  }
  return point_text(direction);
}

/// A TOML basic string; what is not UTF-8, which TOML cannot hold, becomes '?'.
std::string string_text(std::string_view value) {
  std::string text = "\"";
  while (!value.empty()) {
    const std::size_t length = utf8_length(value);
    const char first = value[0];
    if (length == 0) {
      text += '?';
    } else if (first == '"' || first == '\\') {
      text += {'\\', first};
    } else if ((first >= 0 && first < ' ') || first == 0x7F) {
      constexpr std::string_view kHex = "0123456789ABCDEF";
      text += {'\\', 'u', '0', '0', kHex[first >> 4], kHex[first & 15]};
    } else {
      text += value.substr(0, length);
    }
    value.remove_prefix(std::max<std::size_t>(1, length));
  }
  return text + "\"";
}

/// What check_rig_skeleton() asks, and names that tell joints apart.
void check_names(const RigSkeleton& rig) {
  check_rig_skeleton(rig, "to_rig_text");
  std::map<std::string, int> joint_of_name;
  for (int joint = 0; joint < rig.joint_count(); ++joint) {
    const std::string& name = rig.joints[joint].name;
    if (name.empty()) throw std::invalid_argument("to_rig_text: joint " + std::to_string(joint) + " has no name");
    if (!joint_of_name.emplace(name, joint).second) {
      throw std::invalid_argument("to_rig_text: two joints are named " + in_quotes(name));
    }
  }
}

std::string joint_text(const RigJoint& joint, const RigSkeleton& rig) {
  std::string text = "\n[[joint]]\nname = " + string_text(joint.name) + "\n";
  if (joint.parent >= 0) text += "parent = " + string_text(rig.joints[joint.parent].name) + "\n";
  if (joint.role) text += "role = " + string_text(role_name(*joint.role)) + "\n";
  text += "position = " + point_text(joint.position) + "\n";
  if (joint.tip) text += "tip = " + point_text(*joint.tip) + "\n";
  if (joint.cylinder_radius) text += "cylinder_radius = " + number_text(*joint.cylinder_radius) + "\n";
  if (joint.sphere_radius) text += "sphere_radius = " + number_text(*joint.sphere_radius) + "\n";
  if (joint.helpers.empty()) return text;
  text += "helpers = [\n";
  for (const Segment& helper : joint.helpers) {
    text += "  { from = " + point_text(helper.from) + ", to = " + point_text(helper.to) + " },\n";
  }
  return text + "]\n";
}

}  // namespace

RigSkeleton parse_rig(std::string_view text, const std::filesystem::path& name) {
  refuse_disguises(text, name, "a rig file");
  toml::table root;
  try {
    root = toml::parse(text, name.string());
  } catch (const toml::parse_error& error) {
    throw FileError(name, std::max<long>(1, error.source().begin.line), printable_name(error.description()));
  }
  return RigReader(name).read(root);
}

RigSkeleton read_rig(const std::filesystem::path& path) {
  constexpr std::size_t kLargestFile = 16 << 20;  // bytes; a rig of a thousand joints has a hundredth of it
  const std::vector<std::byte> bytes = read_whole_file(path, kLargestFile);
  return parse_rig({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path);
}

std::string to_rig_text(const RigSkeleton& rig) {
  check_names(rig);
  std::string text = "schema = " + string_text(kSchema) + "\n";
  if (!rig.mesh.empty()) text += "mesh = " + string_text(rig.mesh) + "\n";
  text += "up = " + direction_text(rig.up) + "\nfront = " + direction_text(rig.front) + "\n";
  for (const RigJoint& joint : rig.joints) text += joint_text(joint, rig);
  if (!rig.map.empty()) text += "\n[map]\n";
  for (const auto& [joint, clip_joint] : rig.map) text += string_text(joint) + " = " + string_text(clip_joint) + "\n";
  return text;
}

}  // namespace sinew
