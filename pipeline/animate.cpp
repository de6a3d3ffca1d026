#include "pipeline/animate.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "pipeline/preview.h"
#include "skeleton/unusable_input.h"

namespace sinew {
namespace {

void check_options(const Motion& motion, const AnimateOptions& options, int last_frame) {
  if (options.chunk < 1) {
    throw std::invalid_argument("animate: chunk is " + std::to_string(options.chunk) +
                                "; expected 1 or more");
  }
  if (options.first_frame < 0 || options.first_frame > last_frame || last_frame >= motion.frame_count()) {
    throw std::invalid_argument("animate: frames " + std::to_string(options.first_frame) + " to " +
                                std::to_string(last_frame) + " of a motion with " +
                                std::to_string(motion.frame_count()) + " frames");
  }
}

void check_pose(const Rig& rig, const Motion& motion, int frame) {
  const Pose& pose = motion.poses[frame];
  if (pose.joint_count() != rig.skeleton.joint_count()) {
    throw std::invalid_argument("animate: frame " + std::to_string(frame) + " has " +
                                std::to_string(pose.joint_count()) + " joints, the rig " +
                                std::to_string(rig.skeleton.joint_count()));
  }
  for (int joint = 0; joint < pose.joint_count(); ++joint) {
    if (pose.positions[joint].allFinite() && pose.rotations[joint].coeffs().allFinite() &&
        std::isfinite(pose.scales[joint])) {
      continue;
    }
    throw UnusableInput("frame " + std::to_string(frame) + " of '" + motion.name + "': joint '" +
                        rig.skeleton.joints[joint].name + "' has a value that is not a finite number");
  }
}

/// Frames in either mode.
class FrameAnswers {
 public:
  FrameAnswers(const Rig& rig, const AnimateOptions& options, ThreadTeam& team) : chunk_(options.chunk) {
    if (options.mode == FrameMode::preview) {
      preview_.emplace(rig, team);
    } else {
      solver_.emplace(rig, options.frame, team);
    }
  }

  /// The first frame that `frame` depends on.
  int first_needed(int frame) const { return preview_ ? frame : frame / chunk_ * chunk_; }

  /// Positions are left alone where `frame` is not `wanted`, but needed by a later one.
  FrameReport answer(int frame, const Pose& pose, bool wanted, Field3& positions) {
    if (preview_) return timed_preview(pose, positions);
    if (frame % chunk_ == 0) solver_->forget();
    const FrameReport report = solver_->solve(pose);
    if (wanted) solver_->read_positions(positions);
    return report;
  }

 private:
  FrameReport timed_preview(const Pose& pose, Field3& positions) {
    const auto begin = std::chrono::steady_clock::now();
    preview_->answer(pose, positions);
    const std::chrono::duration<double, std::milli> took = std::chrono::steady_clock::now() - begin;
    FrameReport report{.converged = true};
    report.milliseconds[static_cast<int>(FrameStage::start)] = took.count();
    return report;
  }

  int chunk_;
  std::optional<FrameSolver> solver_;
  std::optional<Preview> preview_;
};

/// Pieces of straight line between joints, and the rig's tips, wherever the pose takes them.
class MovingSkeleton {
 public:
  explicit MovingSkeleton(const Rig& rig) : rig_(rig) {
    for (const Bone& bone : rig.binding.bones) {
      for (const Segment& segment : bone.segments) segments_.push_back({bone.joint, segment});
    }
    placed_.resize(segments_.size());
  }

  /// Largest distance of a surface vertex from the nearest segment.
  double farthest_vertex(const Pose& pose, const Field3& positions) {
    for (std::size_t k = 0; k < segments_.size(); ++k) {
      placed_[k] = {carried(pose, segments_[k].first, segments_[k].second.from),
                    carried(pose, segments_[k].first, segments_[k].second.to)};
    }
    double farthest = 0.0;  // squared
    std::size_t last_near = 0;
    for (int vertex = 0; vertex < rig_.volume.surface_count; ++vertex) {
      const Eigen::Vector3d point = positions.row(vertex).transpose();
      double nearest = std::numeric_limits<double>::infinity();
      // Neighboring vertices have the same bone nearby; once one is within the farthest distance
      // so far, the vertex cannot raise it.
      for (std::size_t k = 0; k < placed_.size() && nearest > farthest; ++k) {
        const std::size_t segment = k == 0 ? last_near : (k <= last_near ? k - 1 : k);
        const double distance = squared_distance(placed_[segment], point);
        if (distance < nearest) {
          nearest = distance;
          last_near = k == 0 ? last_near : segment;
        }
      }
      farthest = std::max(farthest, nearest);
    }
    return std::sqrt(farthest);
  }

 private:
  Eigen::Vector3d carried(const Pose& pose, int joint, const Eigen::Vector3d& point) const {
    const Eigen::Vector3d arm = point - rig_.skeleton.joints[joint].position;
    return pose.positions[joint] + pose.scales[joint] * (pose.rotations[joint] * arm);
  }

  static double squared_distance(const Segment& segment, const Eigen::Vector3d& point) {
    const Eigen::Vector3d direction = segment.to - segment.from;
    const double length = direction.squaredNorm();
    const double along =
        length > 0.0 ? std::clamp((point - segment.from).dot(direction) / length, 0.0, 1.0) : 0.0;
    return (point - segment.from - along * direction).squaredNorm();
  }

  const Rig& rig_;
  std::vector<std::pair<int, Segment>> segments_;
  std::vector<Segment> placed_;
};

/// Extent of the body along the rig's up direction.
double rest_height(const Rig& rig) {
  if (rig.mesh.vertex_count() == 0) return 0.0;
  const Eigen::RowVector3d up = rig.skeleton.up.normalized().transpose();
  double low = rig.mesh.positions.row(0).dot(up);
  double high = low;
  for (int vertex = 1; vertex < rig.mesh.vertex_count(); ++vertex) {
    const double along = rig.mesh.positions.row(vertex).dot(up);
    low = std::min(low, along);
    high = std::max(high, along);
  }
  return high - low;
}

}  // namespace

void animate(const Rig& rig, const Motion& motion, const AnimateOptions& options, ThreadTeam& team,
             const std::function<bool(const FrameResult&)>& sink) {
  const int last_frame = options.last_frame < 0 ? motion.frame_count() - 1 : options.last_frame;
  check_options(motion, options, last_frame);
  FrameAnswers answers(rig, options, team);
  MovingSkeleton skeleton(rig);
  Field3 positions(rig.mesh.vertex_count(), 3);
  const double rest_volume = enclosed_volume(rig.mesh, rig.mesh.positions);
  const double height = rest_height(rig);
  for (int frame = answers.first_needed(options.first_frame); frame <= last_frame; ++frame) {
    check_pose(rig, motion, frame);
    FrameResult result;
    result.frame = frame;
    const bool wanted = frame >= options.first_frame;
    result.report = answers.answer(frame, motion.poses[frame], wanted, positions);
    if (!wanted) continue;
    result.positions = &positions;
    if (rest_volume != 0.0) {
      result.volume_ratio = enclosed_volume(rig.mesh, positions) / rest_volume;
    }
    if (height > 0.0)
      result.farthest_from_skeleton = skeleton.farthest_vertex(motion.poses[frame], positions) / height;
    if (!sink(result)) return;
  }
}

}  // namespace sinew
