#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

namespace sinew {

/// Frames as they are kept: 3 * vertex_count floats each, x y z of vertex 0 first.
using FrameSpan = std::span<const std::vector<float>>;

/// The rigid part of a clip: frame f moves rest point p to rotations[f] * (p - rest_centre) + centres[f].
/// All numbers are floats, because that is what a file stores; rotations are normalized floats.
struct RigidMotion {
  Eigen::Vector3f rest_centre = Eigen::Vector3f::Zero();
  std::vector<Eigen::Quaternionf> rotations;
  std::vector<Eigen::Vector3f> centres;
};

/// Rotation and translation that bring `rest` closest to each frame in the least-squares sense
/// [Kabsch 1976]; signs of the quaternions run on without jumps. Linear.
RigidMotion fit_rigid_motion(std::span<const float> rest, FrameSpan frames);

/// A clip as morph targets: frame f, before its rigid motion, is
/// rest + sum over k of weights[f * target_count() + k] * targets[k].
struct MorphClip {
  std::vector<std::vector<float>> targets;  ///< 3 * vertex_count floats each
  std::vector<float> weights;               ///< one row per frame, all within [0, 1]
  bool has_offset = false;                  ///< target 0 has weight 1 in every frame

  int target_count() const { return static_cast<int>(targets.size()); }
};

struct MorphOptions {
  int max_targets = 63;     ///< including the offset target
  double tolerance = 1e-3;  ///< wanted p99.9 error, a length
  double smallest = 1e-9;   ///< motions shorter than this length are rounding, not motion
};

/// Principal components of what `motion` leaves of `frames` [Alexa and Mueller 2000], from at most
/// 250 evenly picked frames; every frame is projected by least squares. Viewers clamp morph weights to
/// [0, 1], so component k with coefficients from low to high becomes the target (high - low) B_k, and
/// the mean plus the sum of low B_k one offset target of weight 1. The fewest components that meet the
/// tolerance over all frames, or max_targets.
///
/// One Gram matrix of the picked frames, then a few passes over all of them in blocks of vertices:
/// O(vertices * frames * targets) time, 4 * 3 * 64 bytes a vertex. Serial and deterministic.
MorphClip fit_morph_targets(std::span<const float> rest, FrameSpan frames, const RigidMotion& motion,
                            const MorphOptions& options);

/// Distances between decoded and true vertices, as lengths.
struct ShapeError {
  double max = 0.0;
  double p999 = 0.0;  ///< rounded up by at most 0.05 per cent
  double rms = 0.0;
};

/// Collects distances; quantiles from a histogram over the leading bits of their float form.
class ErrorStatistics {
 public:
  ErrorStatistics();
  void add(double distance);
  ShapeError result() const;

 private:
  std::vector<std::int64_t> counts_;
  std::int64_t total_ = 0;
  double max_ = 0.0;
  double sum_of_squares_ = 0.0;
};

/// Decodes every frame from the stored numbers, in double, and compares.
ShapeError measure_morph_clip(std::span<const float> rest, FrameSpan frames, const RigidMotion& motion,
                              const MorphClip& clip);

/// Shape of frame f with its rigid motion taken out: 3 * vertex_count numbers.
void remove_rigid_motion(const RigidMotion& motion, int frame, std::span<const float> positions,
                         std::span<double> local);

}  // namespace sinew
