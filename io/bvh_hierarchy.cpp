#include "io/bvh_hierarchy.h"

#include <algorithm>
#include <array>
#include <utility>

#include "io/text_scanner.h"

namespace sinew {
namespace {

constexpr std::array<const char*, 6> kChannelNames = {"Xposition", "Yposition", "Zposition",
                                                      "Xrotation", "Yrotation", "Zrotation"};

Eigen::Vector3d take_vector(BvhText& text) {
  Eigen::Vector3d vector;
  for (double& component : vector) {
    text.skip_space();
    component = text.take_number();
  }
  return vector;
}

/// A joint whose closing brace is still to come.
struct OpenJoint {
  int joint;
  bool has_offset = false;
  bool has_channels = false;
};

class HierarchyReader {
 public:
  explicit HierarchyReader(BvhText& text) : text_(text) {}

  BvhHierarchy read() {
    text_.expect("HIERARCHY");
    while (!text_.accept("MOTION")) read_item();
    if (!open_.empty()) text_.fail("found MOTION; expected '}' for joint " + name_of(open_.back().joint));
    if (result_.skeleton.names.empty()) text_.fail("found MOTION; expected ROOT");
    return std::move(result_);
  }

 private:
  void read_item() {
    if (open_.empty()) return read_root();
    if (text_.accept("OFFSET")) return read_offset();
    if (text_.accept("CHANNELS")) return read_channels();
    if (text_.accept("JOINT")) return open_joint(open_.back().joint);
    if (text_.accept("End")) {
      text_.expect("Site");
      return read_end_site();
    }
    if (text_.accept("EndSite")) return read_end_site();
    if (text_.accept("}")) return close_joint();
    text_.fail_expecting("OFFSET, CHANNELS, JOINT, End Site or '}' in joint " + name_of(open_.back().joint));
  }

  void read_root() {
    if (!text_.accept("ROOT")) text_.fail_expecting(result_.skeleton.names.empty() ? "ROOT" : "MOTION");
    if (result_.skeleton.names.size() > 0 && !several_roots_) {
      several_roots_ = true;
      text_.warn("W_BVH_SEVERAL_ROOTS", text_.line(), "a second ROOT; the skeleton has several trees");
    }
    open_joint(-1);
  }

  void open_joint(int parent) {
    std::string_view name = text_.take_name();
    if (name.empty()) {  // the name may stand on a line of its own
      text_.skip_space();
      name = text_.take_name();
    }
    const auto is_control = [](char c) { return static_cast<unsigned char>(c) < 0x20 && c != '\t'; };
    if (name.empty() || std::any_of(name.begin(), name.end(), is_control)) {
      text_.fail("found " + in_quotes(name) + "; expected the name of a joint");
    }
    Skeleton& skeleton = result_.skeleton;
    open_.push_back({.joint = skeleton.joint_count()});
    skeleton.names.emplace_back(name);
    skeleton.parents.push_back(parent);
    skeleton.rest.emplace_back();
    skeleton.tips.emplace_back();
    text_.expect("{");
  }

  void close_joint() {
    if (!open_.back().has_offset) text_.fail("joint " + name_of(open_.back().joint) + " ends; expected OFFSET in it");
    open_.pop_back();
  }

  void read_offset() {
    OpenJoint& open = open_.back();
    if (open.has_offset) text_.fail("a second OFFSET in joint " + name_of(open.joint) + "; expected one");
    open.has_offset = true;
    result_.skeleton.rest[open.joint].translation = take_vector(text_);
  }

  void read_channels() {
    OpenJoint& open = open_.back();
    if (open.has_channels) text_.fail("a second CHANNELS in joint " + name_of(open.joint) + "; expected one");
    open.has_channels = true;
    text_.skip_space();
    const long long count = text_.take_count("channels");
    const long line = text_.line();
    long long listed = 0;
    std::array<bool, 3> placed{};
    for (text_.skip_space(); const char* name = channel_here(); text_.skip_space(), ++listed) take_channel(name, placed);
    if (listed == count) return;
    if (is_keyword_here()) {
      text_.fail_at(line, "joint " + name_of(open.joint) + " lists " + std::to_string(listed) +
                              " channels; expected " + std::to_string(count) + " as CHANNELS says");
    }
    text_.fail_expecting("a channel (Xposition, Yposition, Zposition, Xrotation, Yrotation or Zrotation)");
  }

  /// The canonical name of the channel whose name stands here, or null.
  const char* channel_here() const {
    const auto found = std::find_if(kChannelNames.begin(), kChannelNames.end(),
                                    [&](const char* name) { return equal_ignoring_case(text_.peek_word(), name); });
    return found == kChannelNames.end() ? nullptr : *found;
  }

  bool is_keyword_here() const {
    constexpr std::array<const char*, 9> kKeywords = {"OFFSET", "CHANNELS", "JOINT", "ROOT", "End",
                                                      "EndSite", "MOTION", "{", "}"};
    return text_.at_end() || std::any_of(kKeywords.begin(), kKeywords.end(), [&](const char* keyword) {
      return equal_ignoring_case(text_.peek_word(), keyword);
    });
  }

  void take_channel(const char* name, std::array<bool, 3>& placed) {
    const bool position = name[1] == 'p';
    const int axis = name[0] - 'X';
    // Rotations about one axis may repeat (ZXZ); of two positions one would be lost.
    if (position && std::exchange(placed[axis], true)) {
      text_.fail("joint " + name_of(open_.back().joint) + " lists " + name + " twice; expected it once");
    }
    using Kind = BvhChannel::Kind;
    result_.channels.push_back({open_.back().joint, position ? Kind::position : Kind::rotation, axis});
    text_.take_word();
  }

  void read_end_site() {
    const long line = text_.line();
    text_.take_name();  // some exporters name the end of a bone; nothing refers to it
    text_.expect("{");
    if (text_.accept("OFFSET")) {
      result_.skeleton.tips[open_.back().joint].push_back(take_vector(text_));
    } else {
      text_.warn("W_BVH_END_WITHOUT_OFFSET", line, "an End Site without OFFSET; it is left out");
    }
    text_.expect("}");
  }

  std::string name_of(int joint) const { return in_quotes(result_.skeleton.names[joint]); }

  BvhText& text_;
  BvhHierarchy result_;
  std::vector<OpenJoint> open_;  // innermost last
  bool several_roots_ = false;
};

}  // namespace

BvhHierarchy read_bvh_hierarchy(BvhText& text) { return HierarchyReader(text).read(); }

}  // namespace sinew
