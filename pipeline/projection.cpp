// Projection of a right-hand side on earlier solutions: [Fischer 1998].
#include "pipeline/projection.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace sinew {
namespace {

/// Slots per block of parallel work; the sums of a block are added up in the order of the blocks.
constexpr int kBlock = 2048;

/// Mixtures of differences that are this short, as a share of the longest one's square, are rounding.
constexpr double kRounding = 1e-6;

int block_count(int count) {
  return (count + kBlock - 1) / kBlock;
}

}  // namespace

Projection::Projection(const FrameNodes& nodes, ThreadTeam& team) : nodes_(nodes), team_(team) {
  const SlotRows zero(nodes.free_count, Eigen::Vector4f::Zero());
  differences_.fill(zero);
  images_.fill(zero);
  block_sums_.resize(block_count(nodes.free_count));
}

/// A times rows, at a slot.
Eigen::Vector4f Projection::image_row(const SlotRows& rows, int slot) const {
  Eigen::Vector4f sum = Eigen::Vector4f::Zero();
  nodes_.for_each_neighbor(slot, [&](int neighbor, float weight) {
    // Held neighbors are the same for both answers as far as A knows: their motion is part of b.
    sum +=
        weight * (neighbor < nodes_.free_count ? Eigen::Vector4f(rows[slot] - rows[neighbor]) : rows[slot]);
  });
  return sum;
}

void Projection::add(const SlotRows& newer, const SlotRows& older) {
  SlotRows& difference = differences_[oldest_];
  SlotRows& image = images_[oldest_];
  const int count = nodes_.free_count;
  team_.for_each_block(block_count(count), [&](int block) {
    for (int slot = block * kBlock; slot < std::min(count, (block + 1) * kBlock); ++slot) {
      difference[slot] = newer[slot] - older[slot];
    }
  });
  team_.for_each_block(block_count(count), [&](int block) {
    for (int slot = block * kBlock; slot < std::min(count, (block + 1) * kBlock); ++slot) {
      image[slot] = image_row(difference, slot);
    }
  });
  oldest_ = (oldest_ + 1) % kDifferences;
  known_ = std::min(known_ + 1, kDifferences);
}

Projection::Products Projection::sum_products(std::span<const Eigen::Vector4f> residual) {
  const int count = nodes_.free_count;
  Products zero;
  zero.images.fill(Eigen::Array4d::Zero());
  zero.residual.fill(Eigen::Array4d::Zero());
  team_.for_each_block(block_count(count), [&](int block) {
    Products sum = zero;
    for (int slot = block * kBlock; slot < std::min(count, (block + 1) * kBlock); ++slot) {
      const Eigen::Array4d left = residual[slot].array().cast<double>();
      for (int i = 0; i < known_; ++i) {
        const Eigen::Array4d difference = differences_[i][slot].array().cast<double>();
        sum.residual[i] += difference * left;
        for (int j = 0; j < known_; ++j) {
          sum.images[kDifferences * i + j] += difference * images_[j][slot].array().cast<double>();
        }
      }
    }
    block_sums_[block] = sum;
  });
  Products all = zero;
  for (const Products& sum : block_sums_) {
    for (std::size_t k = 0; k < sum.images.size(); ++k) all.images[k] += sum.images[k];
    for (std::size_t k = 0; k < sum.residual.size(); ++k) all.residual[k] += sum.residual[k];
  }
  return all;
}

/// Least squares in three unknowns a column; what the differences do not span stays out.
void Projection::solve_weights(const Products& products) {
  weights_.fill(Eigen::Vector4f::Zero());
  for (int column = 0; column < 3; ++column) {
    Eigen::Matrix3d lengths = Eigen::Matrix3d::Zero();
    Eigen::Vector3d along = Eigen::Vector3d::Zero();
    for (int i = 0; i < known_; ++i) {
      along[i] = products.residual[i][column];
      for (int j = 0; j < known_; ++j) {
        lengths(i, j) = 0.5 * (products.images[kDifferences * i + j][column] +
                               products.images[kDifferences * j + i][column]);
      }
    }
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> parts(lengths);
    const double longest = parts.eigenvalues()[2];
    for (int part = 0; part < 3; ++part) {
      const double length = parts.eigenvalues()[part];
      if (!(length > kRounding * longest)) continue;
      const Eigen::Vector3d direction = parts.eigenvectors().col(part);
      const Eigen::Vector3d share = direction.dot(along) / length * direction;
      for (int i = 0; i < known_; ++i) weights_[i][column] += static_cast<float>(share[i]);
    }
  }
}

void Projection::improve(SlotRows& start, std::span<Eigen::Vector4f> residual) {
  if (known_ == 0) return;
  solve_weights(sum_products(residual));
  const int count = nodes_.free_count;
  team_.for_each_block(block_count(count), [&](int block) {
    for (int slot = block * kBlock; slot < std::min(count, (block + 1) * kBlock); ++slot) {
      for (int i = 0; i < known_; ++i) {
        start[slot] += weights_[i].cwiseProduct(differences_[i][slot]);
        residual[slot] -= weights_[i].cwiseProduct(images_[i][slot]);
      }
    }
  });
}

std::size_t Projection::bytes() const {
  return 2 * kDifferences * differences_.front().size() * sizeof(Eigen::Vector4f) +
         block_sums_.size() * sizeof(Products);
}

}  // namespace sinew
