// Interpolation after the glTF 2.0 specification, appendix C.
#include "io/gltf_tracks.h"

#include <algorithm>
#include <cstdint>

#include "io/file_error.h"

namespace sinew {
namespace {

/// Numbers one animation may decode to, since channels can share an accessor and so multiply it: 1 GiB, or
/// two hours of 60 joints at 30 Hz.
constexpr std::uint64_t kMostNumbers = std::uint64_t{128} << 20;

/// Appendix C.4: slerp over the shorter arc.
Eigen::Vector4d turned(const Eigen::Vector4d& from, const Eigen::Vector4d& to, double share) {
  const Eigen::Quaterniond first(from), second(to);
  return first.slerp(share, second).coeffs();
}

void check_times(const std::vector<double>& times, const std::string& where) {
  if (times.front() < 0.0) throw FileError(FileFault::malformed, where, "the first key time is negative");
  for (std::size_t key = 1; key < times.size(); ++key) {
    if (times[key] > times[key - 1]) continue;
    throw FileError(FileFault::malformed, where,
                    "key time " + std::to_string(key) + " is not later than the one before");
  }
}

}  // namespace

std::vector<Transform> rest_locals(const GltfDocument& document) {
  std::vector<Transform> local;
  local.reserve(document.nodes.size());
  for (const GltfNode& node : document.nodes) local.push_back(node.rest);
  return local;
}

std::vector<Eigen::Affine3d> node_worlds(const GltfDocument& document, const std::vector<Transform>& local) {
  std::vector<Eigen::Affine3d> world(document.nodes.size());
  for (const int index : document.node_order) {
    const GltfNode& node = document.nodes[index];
    const Eigen::Affine3d own = node.rest_matrix ? *node.rest_matrix : local[index].matrix();
    world[index] = node.parent < 0 ? own : world[node.parent] * own;
  }
  return world;
}

GltfTracks::GltfTracks(const GltfDocument& document, int animation) : document_(document) {
  const GltfAnimation& from = document.animations[animation];
  const std::string where = document.where("animations", animation);
  bool has_weights = false;
  std::uint64_t numbers = 0;
  for (const GltfChannel& channel : from.channels) {
    if (channel.path == GltfPath::weights) {
      has_weights = true;
      continue;
    }
    const GltfSampler& sampler = from.samplers[channel.sampler];
    numbers += document.accessors[sampler.input].count + document.accessors[sampler.output].count * 4;
    if (numbers > kMostNumbers) {
      throw FileError(FileFault::resource, where,
                      "has more than " + std::to_string(kMostNumbers) + " numbers");
    }
    tracks_.push_back(decode(sampler, channel, where + "/samplers/" + std::to_string(channel.sampler)));
    seconds_ = std::max(seconds_, tracks_.back().times.back());
  }
  if (has_weights) warnings_.push_back("W_GLTF_WEIGHTS: channels that move morph targets are ignored");
}

GltfTracks::Track GltfTracks::decode(const GltfSampler& sampler, const GltfChannel& channel,
                                     const std::string& where) const {
  const GltfAccessor& output = document_.accessors[sampler.output];
  if (output.component_type != 5126 && !(channel.path == GltfPath::rotation && output.normalized)) {
    throw FileError(FileFault::malformed, where + "/output",
                    "accessor is not of floats or normalized rotations");
  }
  Track track{channel.node, channel.path, sampler.interpolation, read_numbers(document_, sampler.input),
              read_numbers(document_, sampler.output)};
  check_times(track.times, where + "/input");
  if (track.path != GltfPath::rotation) return track;
  // Tangents of a cubic rotation have no unit length and keep what they have.
  const bool cubic = track.interpolation == GltfInterpolation::cubic;
  for (std::size_t key = 0; key < track.times.size(); ++key) {
    Eigen::Map<Eigen::Vector4d> value(track.values.data() + 4 * (cubic ? 3 * key + 1 : key));
    if (!(value.norm() > 1e-6)) {
      throw FileError(FileFault::malformed, where + "/output",
                      "rotation " + std::to_string(key) + " has no length");
    }
    if (!cubic) value.normalize();
  }
  return track;
}

Eigen::Vector4d GltfTracks::Track::key(std::size_t index) const {
  Eigen::Vector4d result = Eigen::Vector4d::Zero();
  for (int i = 0; i < components(); ++i) result[i] = values[index * components() + i];
  return result;
}

Eigen::Vector4d GltfTracks::Track::at(double seconds) const {
  const bool cubic = interpolation == GltfInterpolation::cubic;
  const auto value = [&](std::size_t k) { return key(cubic ? 3 * k + 1 : k); };
  const auto after = std::upper_bound(times.begin(), times.end(), seconds);
  if (after == times.begin()) return value(0);
  if (after == times.end()) return value(times.size() - 1);
  const auto next = static_cast<std::size_t>(after - times.begin());
  const std::size_t last = next - 1;
  if (interpolation == GltfInterpolation::step) return value(last);
  const double span = times[next] - times[last];
  const double s = (seconds - times[last]) / span;
  if (!cubic && path == GltfPath::rotation) return turned(value(last), value(next), s);
  if (!cubic) return (1.0 - s) * value(last) + s * value(next);
  // Hermite spline: the tangents are per second, hence the span.
  const Eigen::Vector4d out_tangent = key(3 * last + 2), in_tangent = key(3 * next);
  const double s2 = s * s, s3 = s2 * s;
  return (2 * s3 - 3 * s2 + 1) * value(last) + span * (s3 - 2 * s2 + s) * out_tangent +
         (3 * s2 - 2 * s3) * value(next) + span * (s3 - s2) * in_tangent;
}

std::vector<Transform> GltfTracks::locals(double seconds) const {
  std::vector<Transform> local = rest_locals(document_);
  for (const Track& track : tracks_) {
    const Eigen::Vector4d value = track.at(seconds);
    Transform& node = local[track.node];
    if (track.path == GltfPath::translation) node.translation = value.head<3>();
    if (track.path == GltfPath::scale) node.scale = value.head<3>();
    // A cubic spline can pass through nothing half-way between opposite rotations; there the rest stays.
    if (track.path == GltfPath::rotation && value.norm() > 1e-9) node.rotation.coeffs() = value.normalized();
  }
  return local;
}

}  // namespace sinew
