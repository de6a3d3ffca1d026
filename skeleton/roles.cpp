#include "skeleton/roles.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <span>

namespace sinew {
namespace {

constexpr std::array<std::string_view, kRoleCount> kRoleNames = {
    "hips",           "spine",           "chest",           "upper_chest",     "neck",
    "head",           "left_shoulder",   "left_upper_arm",  "left_lower_arm",  "left_hand",
    "right_shoulder", "right_upper_arm", "right_lower_arm", "right_hand",      "left_upper_leg",
    "left_lower_leg", "left_foot",       "left_toes",       "right_upper_leg", "right_lower_leg",
    "right_foot",     "right_toes",
};

/// How a family of programs calls its joints: for each part of the body the accepted words, best
/// first, without side, separators or capitals. The same word means different joints in different
/// schemes ("LeftLeg" is a shin or a thigh, "LeftShoulder" a collar bone or an upper arm), so a
/// skeleton is judged by whole schemes and words are never mixed between them.
struct Scheme {
  std::string_view name;
  std::string_view hips, spine, neck, head;
  std::string_view shoulder, upper_arm, lower_arm, hand;
  std::string_view upper_leg, lower_leg, foot, toes;
};

// clang-format off: a scheme reads best as trunk, arm and leg
constexpr Scheme kSchemes[] = {
    {.name = "Mixamo, LaFAN1, Perception Neuron, CMU (MotionBuilder)",
     .hips = "hips hip", .spine = "lowerback spine spine1 spine2 spine3 spine4",
     .neck = "neck", .head = "head",
     .shoulder = "shoulder collar", .upper_arm = "arm upperarm", .lower_arm = "forearm",
     .hand = "hand",
     .upper_leg = "upleg thigh", .lower_leg = "leg shin", .foot = "foot", .toes = "toebase toe toes"},
    {.name = "Biovision, CMU (3ds Max), Xsens",
     .hips = "hips", .spine = "lowerback ab spine chest chest2 chest3 chest4",
     .neck = "lowerneck neck", .head = "head",
     .shoulder = "collar", .upper_arm = "shoulder", .lower_arm = "elbow", .hand = "wrist",
     .upper_leg = "hip", .lower_leg = "knee", .foot = "ankle", .toes = "toe toes"},
    {.name = "Daz, Poser, CMU (Daz)",
     .hips = "hip", .spine = "abdomen abdomen2 abdomenlower abdomenupper chest chestlower chestupper",
     .neck = "necklower neck", .head = "head",
     .shoulder = "collar", .upper_arm = "shldr shldrbend", .lower_arm = "forearm forearmbend",
     .hand = "hand",
     .upper_leg = "thigh thighbend", .lower_leg = "shin", .foot = "foot", .toes = "toe toes"},
    {.name = "Unity, VRM, Bandai-Namco, KayKit",
     .hips = "hips", .spine = "spine chest upperchest", .neck = "neck", .head = "head",
     .shoulder = "shoulder", .upper_arm = "upperarm", .lower_arm = "lowerarm", .hand = "wrist hand",
     .upper_leg = "upperleg", .lower_leg = "lowerleg", .foot = "foot", .toes = "toes toebase toe"},
    {.name = "3ds Max Biped, Valve",
     .hips = "pelvis", .spine = "spine spine1 spine2 spine3 spine4", .neck = "neck neck1",
     .head = "head head1",
     .shoulder = "clavicle", .upper_arm = "upperarm", .lower_arm = "forearm", .hand = "hand",
     .upper_leg = "thigh", .lower_leg = "calf", .foot = "foot", .toes = "toe0 toe"},
    {.name = "Rokoko",
     .hips = "hip hips", .spine = "spine chest", .neck = "neck", .head = "head",
     .shoulder = "shoulder", .upper_arm = "upperarm", .lower_arm = "lowerarm", .hand = "hand",
     .upper_leg = "upleg thigh", .lower_leg = "leg shin", .foot = "foot", .toes = "toe"},
    {.name = "Unreal",
     .hips = "pelvis", .spine = "spine01 spine02 spine03 spine04 spine05", .neck = "neck01 neck",
     .head = "head",
     .shoulder = "clavicle", .upper_arm = "upperarm", .lower_arm = "lowerarm", .hand = "hand",
     .upper_leg = "thigh", .lower_leg = "calf", .foot = "foot", .toes = "ball"},
    {.name = "MakeHuman",
     .hips = "root", .spine = "spine05 spine04 spine03 spine02 spine01", .neck = "neck01",
     .head = "head",
     .shoulder = "clavicle", .upper_arm = "upperarm01", .lower_arm = "lowerarm01", .hand = "wrist",
     .upper_leg = "upperleg01", .lower_leg = "lowerleg01", .foot = "foot", .toes = "toe11"},
    {.name = "MakeHuman (BVH)",
     .hips = "root", .spine = "spine1 spine2 spine3", .neck = "neck", .head = "head",
     .shoulder = "clavicle", .upper_arm = "uparm", .lower_arm = "loarm", .hand = "hand",
     .upper_leg = "upleg", .lower_leg = "loleg", .foot = "foot", .toes = "toe"},
    {.name = "SMPL",
     .hips = "pelvis", .spine = "spine1 spine2 spine3", .neck = "neck", .head = "head",
     .shoulder = "collar", .upper_arm = "shoulder", .lower_arm = "elbow", .hand = "wrist",
     .upper_leg = "hip", .lower_leg = "knee", .foot = "ankle", .toes = "foot"},
    {.name = "SOMA",
     .hips = "hips", .spine = "spine1 spine2 chest", .neck = "neck1 neck", .head = "head",
     .shoulder = "shoulder", .upper_arm = "arm", .lower_arm = "forearm", .hand = "hand",
     .upper_leg = "leg", .lower_leg = "shin", .foot = "foot", .toes = "toebase toe"},
    {.name = "Rigify",
     .hips = "hips spine", .spine = "spine001 spine002 spine003",
     .neck = "neck spine004", .head = "head spine006",
     .shoulder = "shoulder", .upper_arm = "upperarm", .lower_arm = "forearm", .hand = "hand",
     .upper_leg = "thigh", .lower_leg = "shin", .foot = "foot", .toes = "toe"},
    {.name = "Quaternius",
     .hips = "body", .spine = "hips abdomen torso", .neck = "neck", .head = "head",
     .shoulder = "shoulder", .upper_arm = "upperarm", .lower_arm = "lowerarm",
     .hand = "hand wrist palm palm2",
     .upper_leg = "upperleg", .lower_leg = "lowerleg", .foot = "foot", .toes = "toes toe"},
    {.name = "Reallusion",
     .hips = "hip", .spine = "waist spine01 spine02", .neck = "necktwist01", .head = "head",
     .shoulder = "clavicle", .upper_arm = "upperarm", .lower_arm = "forearm", .hand = "hand",
     .upper_leg = "thigh", .lower_leg = "calf", .foot = "foot", .toes = "toebase"},
};
// clang-format on

enum class Side { none, left, right };

/// A joint's name with its side taken out: "mixamorig:LeftUpLeg" is "upleg" on the left.
struct PlainName {
  std::string word;
  Side side = Side::none;
};

bool is_upper(char c) {
  return std::isupper(static_cast<unsigned char>(c)) != 0;
}
bool is_alnum(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0;
}
bool is_digit(char c) {
  return std::isdigit(static_cast<unsigned char>(c)) != 0;
}

/// Whether a new token starts at `at` inside a run of letters and digits: at "leftUp|Leg" and at
/// "L|Thigh", where one capital is followed by a capitalised word.
bool starts_token(std::string_view name, std::size_t at) {
  if (!is_upper(name[at])) return false;
  if (!is_upper(name[at - 1])) return true;
  return at + 1 < name.size() && is_alnum(name[at + 1]) && !is_upper(name[at + 1]);
}

/// Lower-case tokens of a name, its namespace (up to the last ':' or '|') left out.
std::vector<std::string> tokens_of(std::string_view name) {
  if (const std::size_t end = name.find_last_of(":|"); end != std::string_view::npos)
    name.remove_prefix(end + 1);
  std::vector<std::string> tokens;
  // "__UpLeg_L" above "UpLeg_L" is a helper that only carries an offset: keep it a word of its own.
  if (name.substr(0, 2) == "__") tokens.emplace_back("__");
  bool inside = false;
  for (std::size_t at = 0; at < name.size(); ++at) {
    if (!is_alnum(name[at])) {
      inside = false;
      continue;
    }
    if (!inside || starts_token(name, at)) tokens.emplace_back();
    tokens.back() += static_cast<char>(std::tolower(static_cast<unsigned char>(name[at])));
    inside = true;
  }
  return tokens;
}

Side side_of(std::string_view token) {
  if (token == "left" || token == "l" || token == "lf") return Side::left;
  if (token == "right" || token == "r" || token == "rt") return Side::right;
  return Side::none;
}

/// How many of the names open with `token`; names with one token only are its root and count too.
bool is_shared_prefix(std::span<const std::vector<std::string>> names, const std::string& token) {
  // A character's prefix is on nearly all its joints; helpers and the scene root may go without.
  const auto with_token = std::count_if(names.begin(), names.end(), [&](const auto& tokens) {
    return !tokens.empty() && tokens.front() == token;
  });
  return names.size() >= 4 && 5 * static_cast<std::size_t>(with_token) >= 4 * names.size();
}

/// Takes prefixes such as "mixamorig", "Bip01", "CC_Base" or "Character1" off all names.
void strip_shared_prefixes(std::vector<std::vector<std::string>>& names) {
  constexpr int kLongestPrefix = 3;  // tokens; "ValveBiped.Bip01" is the longest we met
  for (int round = 0; round < kLongestPrefix; ++round) {
    const auto sample = std::find_if(names.begin(), names.end(), [&](const auto& tokens) {
      return tokens.size() > 1 && side_of(tokens.front()) == Side::none &&
             is_shared_prefix(names, tokens.front());
    });
    if (sample == names.end()) return;
    const std::string prefix = sample->front();
    for (auto& tokens : names)
      if (tokens.size() > 1 && tokens.front() == prefix) tokens.erase(tokens.begin());
  }
}

/// Takes off the running number that some exporters append to every name ("Hips_01", "Spine_02").
void strip_running_numbers(std::vector<std::vector<std::string>>& names) {
  std::vector<std::string> numbers;
  for (const auto& tokens : names)
    if (tokens.size() > 1 && std::all_of(tokens.back().begin(), tokens.back().end(), is_digit))
      numbers.push_back(tokens.back());
  std::sort(numbers.begin(), numbers.end());
  const bool distinct = std::adjacent_find(numbers.begin(), numbers.end()) == numbers.end();
  if (!distinct || numbers.size() < 10 || 5 * numbers.size() < 4 * names.size()) return;
  for (auto& tokens : names)
    if (tokens.size() > 1 && std::all_of(tokens.back().begin(), tokens.back().end(), is_digit))
      tokens.pop_back();
}

/// Splits "leftarm" into "left" and "arm", for names written in lower case throughout.
void split_written_out_side(std::vector<std::string>& tokens) {
  for (const std::string_view side : {"left", "right"}) {
    std::string& first = tokens.front();
    if (first.size() <= side.size() || first.compare(0, side.size(), side) != 0) continue;
    const std::string rest = first.substr(side.size());
    first = std::string(side);
    tokens.insert(tokens.begin() + 1, rest);
    return;
  }
}

PlainName plain_name(std::vector<std::string> tokens) {
  PlainName plain;
  if (tokens.empty()) return plain;
  // Deformation and original bones of Blender rigs, and VRoid's mark for "centre", say no role.
  for (const std::string_view mark : {"def", "org", "c"})
    if (tokens.size() > 1 && tokens.front() == mark) tokens.erase(tokens.begin());
  split_written_out_side(tokens);
  for (const std::string& token : tokens) {
    const Side side = side_of(token);
    if (side != Side::none && plain.side == Side::none)
      plain.side = side;
    else
      plain.word += token;
  }
  return plain;
}

std::vector<PlainName> plain_names(const Skeleton& skeleton) {
  std::vector<std::vector<std::string>> tokens;
  for (const std::string& name : skeleton.names) tokens.push_back(tokens_of(name));
  strip_shared_prefixes(tokens);
  strip_running_numbers(tokens);
  std::vector<PlainName> plain;
  for (auto& name : tokens) plain.push_back(plain_name(std::move(name)));
  return plain;
}

bool hangs_below(const Skeleton& skeleton, int joint, int ancestor) {
  for (int above = skeleton.parents[joint]; above >= 0; above = skeleton.parents[above])
    if (above == ancestor) return true;
  return false;
}

/// The topmost joint called by the earliest of `words`, or -1.
int find_joint(std::span<const PlainName> names, std::string_view words, Side side) {
  while (!words.empty()) {
    const std::string_view word = words.substr(0, words.find(' '));
    words.remove_prefix(std::min(words.size(), word.size() + 1));
    for (std::size_t joint = 0; joint < names.size(); ++joint)
      if (names[joint].side == side && names[joint].word == word) return static_cast<int>(joint);
  }
  return -1;
}

bool is_among(std::string_view words, std::string_view word) {
  while (!words.empty()) {
    const std::string_view first = words.substr(0, words.find(' '));
    if (first == word) return true;
    words.remove_prefix(std::min(words.size(), first.size() + 1));
  }
  return false;
}

int& joint_of(RoleMap& map, Role role) {
  return map.joint_of_role[static_cast<int>(role)];
}
int joint_of(const RoleMap& map, Role role) {
  return map.joint_of_role[static_cast<int>(role)];
}

/// Spine joints of the scheme on the way from the hips up to the neck, head or arms, hips first.
std::vector<int> spine_chain(const Skeleton& skeleton, std::span<const PlainName> names, const Scheme& scheme,
                             const RoleMap& map) {
  const int hips = joint_of(map, Role::hips);
  std::vector<int> chain;
  for (const Role top : {Role::neck, Role::head, Role::left_upper_arm, Role::right_upper_arm}) {
    const int start = joint_of(map, top);
    if (start < 0 || hips < 0 || !hangs_below(skeleton, start, hips)) continue;
    for (int joint = skeleton.parents[start]; joint != hips; joint = skeleton.parents[joint])
      if (names[joint].side == Side::none && is_among(scheme.spine, names[joint].word))
        chain.insert(chain.begin(), joint);
    if (!chain.empty()) return chain;
  }
  return chain;
}

/// The first spine joint is the spine, the last of three or more the upper chest, and the chest is
/// the middle one.
void assign_spine(const std::vector<int>& chain, RoleMap& map) {
  if (chain.empty()) return;
  joint_of(map, Role::spine) = chain.front();
  if (chain.size() == 2) joint_of(map, Role::chest) = chain.back();
  if (chain.size() < 3) return;
  joint_of(map, Role::chest) = chain[chain.size() / 2];
  joint_of(map, Role::upper_chest) = chain.back();
}

/// The role a joint should hang below, were all roles played.
std::optional<Role> role_above(Role role) {
  switch (role) {
    case Role::hips:
      return std::nullopt;
    case Role::spine:
      return Role::hips;
    case Role::left_shoulder:
    case Role::right_shoulder:
    case Role::neck:
      return Role::upper_chest;
    case Role::left_upper_leg:
    case Role::right_upper_leg:
      return Role::hips;
    default:
      return static_cast<Role>(static_cast<int>(role) - 1);
  }
}

/// Whether the joint that plays `role` hangs below the nearest role above it that is played.
bool hangs_right(const Skeleton& skeleton, const RoleMap& map, Role role) {
  for (std::optional<Role> above = role_above(role); above; above = role_above(*above)) {
    const int ancestor = joint_of(map, *above);
    if (ancestor >= 0) return hangs_below(skeleton, joint_of(map, role), ancestor);
  }
  return true;
}

RoleMap apply_scheme(const Skeleton& skeleton, std::span<const PlainName> names, const Scheme& scheme) {
  RoleMap map{std::string(scheme.name), std::vector<int>(kRoleCount, -1)};
  joint_of(map, Role::hips) = find_joint(names, scheme.hips, Side::none);
  joint_of(map, Role::neck) = find_joint(names, scheme.neck, Side::none);
  joint_of(map, Role::head) = find_joint(names, scheme.head, Side::none);
  const std::string_view arm[] = {scheme.shoulder, scheme.upper_arm, scheme.lower_arm, scheme.hand};
  const std::string_view leg[] = {scheme.upper_leg, scheme.lower_leg, scheme.foot, scheme.toes};
  for (int part = 0; part < 4; ++part) {
    const auto find = [&](Role first, std::string_view words, Side side) {
      map.joint_of_role[static_cast<int>(first) + part] = find_joint(names, words, side);
    };
    find(Role::left_shoulder, arm[part], Side::left);
    find(Role::right_shoulder, arm[part], Side::right);
    find(Role::left_upper_leg, leg[part], Side::left);
    find(Role::right_upper_leg, leg[part], Side::right);
  }
  assign_spine(spine_chain(skeleton, names, scheme, map), map);
  return map;
}

/// Takes out the joints that hang in the wrong place; returns roles played minus those taken out.
int check_hierarchy(const Skeleton& skeleton, RoleMap& map) {
  std::vector<int> misplaced;
  int score = 0;
  for (int role = 0; role < kRoleCount; ++role) {
    if (map.joint_of_role[role] < 0) continue;
    if (hangs_right(skeleton, map, static_cast<Role>(role)))
      ++score;
    else
      misplaced.push_back(role);
  }
  for (const int role : misplaced) map.joint_of_role[role] = -1;
  return score - static_cast<int>(misplaced.size());
}

}  // namespace

std::string_view role_name(Role role) {
  return kRoleNames[static_cast<int>(role)];
}

std::optional<Role> role_from_name(std::string_view name) {
  const auto found = std::find(kRoleNames.begin(), kRoleNames.end(), name);
  if (found == kRoleNames.end()) return std::nullopt;
  return static_cast<Role>(found - kRoleNames.begin());
}

RoleMap recognise_roles(const Skeleton& skeleton) {
  check_skeleton(skeleton, "recognise_roles");
  const std::vector<PlainName> names = plain_names(skeleton);
  RoleMap best{"", std::vector<int>(kRoleCount, -1)};
  int best_score = 0;
  for (const Scheme& scheme : kSchemes) {
    RoleMap map = apply_scheme(skeleton, names, scheme);
    const int score = check_hierarchy(skeleton, map);
    if (score <= best_score) continue;
    best_score = score;
    best = std::move(map);
  }
  return best;
}

}  // namespace sinew
