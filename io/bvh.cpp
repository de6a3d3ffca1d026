#include "io/bvh.h"

#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

#include "io/atomic_file.h"
#include "io/bvh_hierarchy.h"
#include "io/bvh_motion.h"
#include "io/bvh_text.h"
#include "io/file_error.h"
#include "io/text_scanner.h"

namespace sinew {
namespace {

/// Bytes. Counts of joints and frames then fit an int.
constexpr std::size_t kLargestFile = std::size_t{1} << 31;

/// Joints without channels cost a file nothing per frame but cost a clip a transform. Beyond this
/// many transforms, a clip may have one for each byte of its file.
constexpr std::size_t kFreeTransforms = 1'000'000;

void check_file_size(std::string_view text, const std::filesystem::path& name) {
  if (text.size() <= kLargestFile) return;
  throw FileError(FileFault::resource, name.string(),
                  "file has " + std::to_string(text.size()) + " bytes; at most " + std::to_string(kLargestFile) +
                      " are read");
}

Eigen::Quaterniond turn_about(int axis, double degrees) {
  const double half = degrees * (std::numbers::pi / 360.0);
  Eigen::Quaterniond turn(std::cos(half), 0.0, 0.0, 0.0);
  turn.coeffs()[axis] = std::sin(half);
  return turn;
}

/// Joints start each frame as the file declares them; channels replace (positions) or turn on
/// (rotations, each about the axes the ones before it have turned).
void apply_channels(const std::vector<BvhChannel>& channels, const double* values, Transform* joints) {
  for (const BvhChannel& channel : channels) {
    Transform& joint = joints[channel.joint];
    if (channel.kind == BvhChannel::Kind::position) joint.translation[channel.axis] = *values++;
    else joint.rotation = joint.rotation * turn_about(channel.axis, *values++);
  }
}

std::vector<Transform> local_transforms(const BvhHierarchy& hierarchy, const BvhMotion& motion) {
  const std::vector<Transform>& rest = hierarchy.skeleton.rest;
  std::vector<Transform> local;
  local.reserve(rest.size() * static_cast<std::size_t>(motion.frame_count));
  for (int frame = 0; frame < motion.frame_count; ++frame) {
    local.insert(local.end(), rest.begin(), rest.end());
    apply_channels(hierarchy.channels, motion.values.data() + frame * hierarchy.channels.size(),
                   local.data() + frame * rest.size());
  }
  return local;
}

void check_clip_size(const BvhHierarchy& hierarchy, const BvhMotion& motion, std::size_t bytes,
                     const std::filesystem::path& name) {
  const std::size_t joints = hierarchy.skeleton.names.size();
  const auto frames = static_cast<std::size_t>(motion.frame_count);
  const std::size_t most = kFreeTransforms + bytes;
  if (frames <= most / joints) return;
  throw FileError(FileFault::resource, name.string(),
                  std::to_string(frames) + " frames of " + std::to_string(joints) +
                      " joints, most of them without channels; at most " + std::to_string(most / joints) +
                      " frames are read");
}

std::string spelled(const Eigen::Vector3d& vector) {
  std::string result;
  for (const double component : vector) {
    std::array<char, 32> digits{};  // the shortest text of a double takes 24 at most
    const auto end = std::to_chars(digits.data(), digits.data() + digits.size(), component).ptr;
    result.append(result.empty() ? "(" : ", ").append(digits.data(), end);
  }
  return result + ")";
}

/// A few exporters mean root positions as added to OFFSET. It shows where motion begins near the
/// origin though OFFSET is far from it.
void warn_of_added_positions(const Clip& clip, long first_line, BvhText& text) {
  const Eigen::Vector3d offset = clip.skeleton.rest[0].translation;
  const Eigen::Vector3d start = clip.local[0].translation;
  if (start.norm() > 0.1 * offset.norm() || offset.isZero(0.0)) return;
  text.warn("W_BVH_ROOT_AT_ORIGIN", first_line,
            "the root starts at " + spelled(start) + " though its OFFSET is " + spelled(offset) +
                "; positions replace OFFSET");
}

}  // namespace

Clip parse_bvh(std::string_view bytes, const std::filesystem::path& name) {
  check_file_size(bytes, name);
  refuse_disguises(bytes, name, "a BVH file");
  BvhText text(bytes, name);
  BvhHierarchy hierarchy = read_bvh_hierarchy(text);
  const BvhMotion motion = read_bvh_motion(text, hierarchy.channels.size());
  check_clip_size(hierarchy, motion, bytes.size(), name);
  Clip clip;
  clip.name = name.stem().string();
  clip.frames_per_second = motion.frames_per_second;
  clip.frame_count = motion.frame_count;
  clip.local = local_transforms(hierarchy, motion);
  clip.skeleton = std::move(hierarchy.skeleton);
  warn_of_added_positions(clip, motion.first_line, text);
  clip.warnings = text.take_warnings();
  return clip;
}

Clip read_bvh(const std::filesystem::path& path) {
  const std::vector<std::byte> bytes = read_whole_file(path, kLargestFile);
  return parse_bvh({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, path);
}

}  // namespace sinew
