// Kabsch 1976, A solution for the best rotation to relate two sets of vectors.
// Alexa, Mueller 2000, Representing animations by principal components.
#include "io/morph_basis.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <bit>
#include <cmath>

namespace sinew {
namespace {

/// Frames that the basis is computed from. A basis of every fourth frame of a 60 Hz jump was as good
/// as one of all of them, one of every eighth was not.
constexpr int kBasisFrames = 250;

/// Vertices handled together: a block of all frames stays a few megabytes.
constexpr int kBlock = 512;

/// Directions weaker than this share of the strongest (as variances) are lost in the rounding of the
/// Gram matrix.
constexpr double kWeakestVariance = 1e-13;

constexpr int kHistogramShift = 12;  // 11 of 23 mantissa bits stay: bins 0.05 per cent wide

Eigen::Vector3f centre_of(std::span<const float> positions) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const std::size_t count = positions.size() / 3;
  for (std::size_t i = 0; i < count; ++i)
    sum += Eigen::Map<const Eigen::Vector3f>(&positions[3 * i]).cast<double>();
  return (sum / static_cast<double>(std::max<std::size_t>(count, 1))).cast<float>();
}

Eigen::Matrix3d best_rotation(std::span<const float> rest, const Eigen::Vector3f& rest_centre,
                              std::span<const float> positions, const Eigen::Vector3f& centre) {
  const Eigen::Vector3d from_centre = rest_centre.cast<double>();
  const Eigen::Vector3d to_centre = centre.cast<double>();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i + 2 < rest.size(); i += 3) {
    const Eigen::Vector3d from = Eigen::Map<const Eigen::Vector3f>(&rest[i]).cast<double>() - from_centre;
    const Eigen::Vector3d to = Eigen::Map<const Eigen::Vector3f>(&positions[i]).cast<double>() - to_centre;
    covariance += to * from.transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  // The nearest orthogonal matrix may be a reflection; the weakest axis is turned over then.
  Eigen::Vector3d signs = Eigen::Vector3d::Ones();
  signs.z() = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
}

Eigen::Matrix3d matrix_of(const Eigen::Quaternionf& rotation) {
  return rotation.cast<double>().normalized().toRotationMatrix();
}

std::vector<int> evenly_picked(int count, int most) {
  std::vector<int> picked(static_cast<std::size_t>(std::min(count, most)));
  const auto last = static_cast<std::int64_t>(picked.size()) - 1;
  for (std::int64_t i = 0; i <= last; ++i)
    picked[static_cast<std::size_t>(i)] =
        last == 0 ? 0 : static_cast<int>((i * (count - 1) + last / 2) / last);
  return picked;
}

/// Displacements from rest with the rigid motion taken out, a few vertices of chosen frames at a time.
class Displacements {
 public:
  Displacements(std::span<const float> rest, FrameSpan frames, const RigidMotion& motion)
      : rest_(rest), frames_(frames), rest_centre_(motion.rest_centre.cast<double>()) {
    for (std::size_t f = 0; f < frames.size(); ++f) {
      back_.push_back(matrix_of(motion.rotations[f]).transpose());
      centres_.push_back(motion.centres[f].cast<double>());
    }
  }

  int vertex_count() const { return static_cast<int>(rest_.size() / 3); }
  int frame_count() const { return static_cast<int>(frames_.size()); }

  /// Rows: x y z of vertices `first` on; columns: frames.
  void load(int first, int count, std::span<const int> frames, Eigen::MatrixXd& block) const {
    block.resize(3 * count, static_cast<Eigen::Index>(frames.size()));
    for (std::size_t column = 0; column < frames.size(); ++column) {
      const auto f = static_cast<std::size_t>(frames[column]);
      const float* position = frames_[f].data() + 3 * static_cast<std::size_t>(first);
      const float* rest = rest_.data() + 3 * static_cast<std::size_t>(first);
      double* out = block.data() + static_cast<std::size_t>(block.rows()) * column;
      for (int i = 0; i < 3 * count; i += 3) {
        const Eigen::Vector3d local =
            back_[f] * (Eigen::Map<const Eigen::Vector3f>(position + i).cast<double>() - centres_[f]);
        Eigen::Map<Eigen::Vector3d>(out + i) =
            local + rest_centre_ - Eigen::Map<const Eigen::Vector3f>(rest + i).cast<double>();
      }
    }
  }

 private:
  std::span<const float> rest_;
  FrameSpan frames_;
  Eigen::Vector3d rest_centre_;
  std::vector<Eigen::Matrix3d> back_;
  std::vector<Eigen::Vector3d> centres_;
};

/// Calls visit(first, count) for consecutive blocks of vertices.
template <typename Visit>
void for_each_block(int vertex_count, const Visit& visit) {
  for (int first = 0; first < vertex_count; first += kBlock)
    visit(first, std::min(kBlock, vertex_count - first));
}

/// Mean and orthonormal directions (columns), strongest first; coefficients of all frames in them.
struct PrincipalComponents {
  Eigen::VectorXd mean;          ///< 3 * vertex_count
  Eigen::MatrixXf directions;    ///< 3 * vertex_count x component_count
  Eigen::MatrixXd coefficients;  ///< component_count x frame_count
};

/// Columns turn centred picked frames into unit directions: eigenvectors of their Gram matrix over
/// the square roots of its eigenvalues.
Eigen::MatrixXd combinations(const Displacements& displacements, std::span<const int> picked,
                             const MorphOptions& options) {
  const auto count = static_cast<Eigen::Index>(picked.size());
  Eigen::MatrixXd gram = Eigen::MatrixXd::Zero(count, count);
  Eigen::MatrixXd block;
  for_each_block(displacements.vertex_count(), [&](int first, int vertices) {
    displacements.load(first, vertices, picked, block);
    block.colwise() -= block.rowwise().mean().eval();
    gram.selfadjointView<Eigen::Lower>().rankUpdate(block.transpose());
  });
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram);
  const double strongest = eigen.eigenvalues()(count - 1);
  const double floor = std::max(kWeakestVariance * strongest, options.smallest * options.smallest);
  std::vector<Eigen::VectorXd> columns;
  for (Eigen::Index k = count - 1; k >= 0 && static_cast<int>(columns.size()) < options.max_targets - 1;
       --k) {
    if (!(eigen.eigenvalues()(k) > floor)) break;
    Eigen::VectorXd vector = eigen.eigenvectors().col(k);
    // An eigenvector's sign is arbitrary; its largest entry decides, so that it does not depend on the
    // solver.
    Eigen::Index largest = 0;
    vector.cwiseAbs().maxCoeff(&largest);
    if (vector(largest) < 0.0) vector = -vector;
    columns.push_back(vector / std::sqrt(eigen.eigenvalues()(k)));
  }
  Eigen::MatrixXd result(count, static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) result.col(static_cast<Eigen::Index>(k)) = columns[k];
  return result;
}

std::vector<int> all_frames(int count) {
  return evenly_picked(count, count);
}

PrincipalComponents principal_components(const Displacements& displacements, const MorphOptions& options) {
  const std::vector<int> picked = evenly_picked(displacements.frame_count(), kBasisFrames);
  const std::vector<int> every = all_frames(displacements.frame_count());
  const Eigen::MatrixXd mix = combinations(displacements, picked, options);
  const Eigen::Index coordinates = 3 * displacements.vertex_count();
  PrincipalComponents result;
  result.mean.resize(coordinates);
  result.directions.resize(coordinates, mix.cols());
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(mix.cols(), displacements.frame_count());
  Eigen::MatrixXd squares = Eigen::MatrixXd::Zero(mix.cols(), mix.cols());
  Eigen::MatrixXd sample, block, directions;
  for_each_block(displacements.vertex_count(), [&](int first, int vertices) {
    displacements.load(first, vertices, picked, sample);
    const Eigen::VectorXd mean = sample.rowwise().mean();
    sample.colwise() -= mean;
    result.mean.segment(3 * first, 3 * vertices) = mean;
    result.directions.middleRows(3 * first, 3 * vertices) = (sample * mix).cast<float>();
    directions = result.directions.middleRows(3 * first, 3 * vertices).cast<double>();
    displacements.load(first, vertices, every, block);
    block.colwise() -= mean;
    products.noalias() += directions.transpose() * block;
    squares.noalias() += directions.transpose() * directions;
  });
  // Nearly the identity: what is left is the rounding of the directions to floats.
  result.coefficients = squares.ldlt().solve(products);
  return result;
}

/// p99.9 error when the first `count` components are kept.
double error_with(const Displacements& displacements, const PrincipalComponents& components, int count) {
  const std::vector<int> every = all_frames(displacements.frame_count());
  ErrorStatistics statistics;
  Eigen::MatrixXd block;
  Eigen::MatrixXf residual;
  const Eigen::MatrixXf coefficients = components.coefficients.topRows(count).cast<float>();
  for_each_block(displacements.vertex_count(), [&](int first, int vertices) {
    displacements.load(first, vertices, every, block);
    block.colwise() -= components.mean.segment(3 * first, 3 * vertices);
    residual = block.cast<float>();
    residual.noalias() -= components.directions.block(3 * first, 0, 3 * vertices, count) * coefficients;
    const Eigen::Map<const Eigen::Matrix3Xf> vectors(residual.data(), 3, residual.size() / 3);
    for (Eigen::Index i = 0; i < vectors.cols(); ++i) statistics.add(vectors.col(i).norm());
  });
  return statistics.result().p999;
}

int fewest_components(const Displacements& displacements, const PrincipalComponents& components,
                      double tolerance) {
  int too_few = -1;
  int enough = static_cast<int>(components.directions.cols());
  if (enough == 0 || error_with(displacements, components, enough) > tolerance) return enough;
  while (enough - too_few > 1) {
    const int middle = (enough + too_few) / 2;
    (error_with(displacements, components, middle) <= tolerance ? enough : too_few) = middle;
  }
  return enough;
}

/// Component k with the range of its coefficients over the clip.
struct Range {
  Eigen::Index component;
  double low;
  double high;
};

std::vector<Range> ranges_of(const PrincipalComponents& components, int count) {
  std::vector<Range> ranges;
  for (Eigen::Index k = 0; k < count; ++k) {
    const auto row = components.coefficients.row(k);
    if (row.maxCoeff() > row.minCoeff()) ranges.push_back({k, row.minCoeff(), row.maxCoeff()});
  }
  return ranges;
}

std::vector<float> to_floats(const Eigen::VectorXd& values) {
  std::vector<float> floats(static_cast<std::size_t>(values.size()));
  Eigen::Map<Eigen::VectorXf>(floats.data(), values.size()) = values.cast<float>();
  return floats;
}

MorphClip with_weights_from_zero_to_one(const PrincipalComponents& components, int count, double smallest) {
  const std::vector<Range> ranges = ranges_of(components, count);
  MorphClip clip;
  Eigen::VectorXd offset = components.mean;
  for (const Range& range : ranges)
    offset += range.low * components.directions.col(range.component).cast<double>();
  clip.has_offset = offset.size() > 0 && (!ranges.empty() || offset.cwiseAbs().maxCoeff() > smallest);
  if (clip.has_offset) clip.targets.push_back(to_floats(offset));
  for (const Range& range : ranges)
    clip.targets.push_back(
        to_floats((range.high - range.low) * components.directions.col(range.component).cast<double>()));
  for (Eigen::Index f = 0; f < components.coefficients.cols(); ++f) {
    if (clip.has_offset) clip.weights.push_back(1.0F);
    for (const Range& range : ranges) {
      const double share =
          (components.coefficients(range.component, f) - range.low) / (range.high - range.low);
      clip.weights.push_back(std::clamp(static_cast<float>(share), 0.0F, 1.0F));
    }
  }
  return clip;
}

}  // namespace

RigidMotion fit_rigid_motion(std::span<const float> rest, FrameSpan frames) {
  RigidMotion motion;
  motion.rest_centre = centre_of(rest);
  for (const std::vector<float>& frame : frames) {
    const Eigen::Vector3f centre = centre_of(frame);
    Eigen::Quaternionf rotation =
        Eigen::Quaterniond(best_rotation(rest, motion.rest_centre, frame, centre)).normalized().cast<float>();
    const Eigen::Quaternionf& before =
        motion.rotations.empty() ? Eigen::Quaternionf::Identity() : motion.rotations.back();
    // q and -q are one rotation, but a viewer that blends keys turns the short way only between near ones.
    if (rotation.dot(before) < 0.0F) rotation.coeffs() = -rotation.coeffs();
    motion.rotations.push_back(rotation);
    motion.centres.push_back(centre);
  }
  return motion;
}

MorphClip fit_morph_targets(std::span<const float> rest, FrameSpan frames, const RigidMotion& motion,
                            const MorphOptions& options) {
  const Displacements displacements(rest, frames, motion);
  const PrincipalComponents components = principal_components(displacements, options);
  const int count = fewest_components(displacements, components, options.tolerance);
  return with_weights_from_zero_to_one(components, count, options.smallest);
}

ErrorStatistics::ErrorStatistics() : counts_(std::size_t{1} << (31 - kHistogramShift), 0) {}

void ErrorStatistics::add(double distance) {
  const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(distance));
  ++counts_[bits >> kHistogramShift];
  ++total_;
  max_ = std::max(max_, distance);
  sum_of_squares_ += distance * distance;
}

ShapeError ErrorStatistics::result() const {
  ShapeError error{.max = max_, .p999 = 0.0, .rms = 0.0};
  if (total_ == 0) return error;
  error.rms = std::sqrt(sum_of_squares_ / static_cast<double>(total_));
  const auto wanted = total_ - total_ / 1000;
  std::int64_t seen = 0;
  std::size_t bin = 0;
  while ((seen += counts_[bin]) < wanted) ++bin;
  const auto upper_edge = static_cast<std::uint32_t>(bin + 1) << kHistogramShift;
  error.p999 = std::min(max_, static_cast<double>(std::bit_cast<float>(upper_edge)));
  return error;
}

ShapeError measure_morph_clip(std::span<const float> rest, FrameSpan frames, const RigidMotion& motion,
                              const MorphClip& clip) {
  const Displacements displacements(rest, frames, motion);
  const std::vector<int> every = all_frames(displacements.frame_count());
  const Eigen::Index target_count = clip.target_count();
  const Eigen::MatrixXd weights =
      Eigen::Map<const Eigen::MatrixXf>(clip.weights.data(), target_count, displacements.frame_count())
          .cast<double>();
  ErrorStatistics statistics;
  Eigen::MatrixXd block, targets;
  for_each_block(displacements.vertex_count(), [&](int first, int vertices) {
    // The rigid motion keeps distances, so they are taken before it.
    displacements.load(first, vertices, every, block);
    targets.resize(3 * vertices, target_count);
    for (Eigen::Index k = 0; k < target_count; ++k) {
      const float* target =
          clip.targets[static_cast<std::size_t>(k)].data() + 3 * static_cast<std::size_t>(first);
      targets.col(k) = Eigen::Map<const Eigen::VectorXf>(target, 3 * vertices).cast<double>();
    }
    block.noalias() -= targets * weights;
    const Eigen::Map<const Eigen::Matrix3Xd> vectors(block.data(), 3, block.size() / 3);
    for (Eigen::Index i = 0; i < vectors.cols(); ++i) statistics.add(vectors.col(i).norm());
  });
  return statistics.result();
}

void remove_rigid_motion(const RigidMotion& motion, int frame, std::span<const float> positions,
                         std::span<double> local) {
  const auto f = static_cast<std::size_t>(frame);
  const Eigen::Matrix3d back = matrix_of(motion.rotations[f]).transpose();
  const Eigen::Vector3d centre = motion.centres[f].cast<double>();
  const Eigen::Vector3d rest_centre = motion.rest_centre.cast<double>();
  for (std::size_t i = 0; i + 2 < positions.size(); i += 3) {
    Eigen::Map<Eigen::Vector3d> out(&local[i]);
    out = back * (Eigen::Map<const Eigen::Vector3f>(&positions[i]).cast<double>() - centre) + rest_centre;
  }
}

}  // namespace sinew
