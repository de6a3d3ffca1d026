#pragma once

#include <array>

#include "solver/wide.h"

namespace sinew {

/// Neighborhoods fitted at once.
constexpr int kFitLanes = kRegisterFloats;

/// What the edges of as many nodes say, number by number side by side.
struct alignas(64) FitBatch {
  float sum[9][kFitLanes];       ///< row-major: sum over a node's edges of w e' e^T, e at rest, e' deformed
  float rotation[4][kFitLanes];  ///< quaternions x y z w of any length but 0: a guess, and the answer
};

/// What the guess of fit_rotations counts beside a sum of Frobenius norm one. Edges of a sound neighborhood
/// hold it three times as fast. Those of a crushed one may hold it hardly at all, or be fitted by two
/// rotations equally well: there the guess decides, and small errors of the positions make no large ones of
/// the rotations. At a fifth of this, single nodes in creases of fast clips are still off by 1e-3 of the
/// diagonal.
constexpr float kGuessCounts = 0.2f;

/// For each lane the rotation R that maximises trace(R^T (sum / |sum| + kGuessCounts guess)): the local step
/// of as-rigid-as-possible deformation [Sorkine and Alexa 2007], the guess an addition of this project.
///
/// Newton's method on rotations from the guess. Proper (determinant +1) also where a neighborhood is turned
/// inside out. A zero sum keeps its guess. Right to single precision; the lanes do not influence one
/// another's answers beyond that. Two batches at once take a sixth less than one after the other.
void fit_rotations(FitBatch& batch);
void fit_rotations(std::array<FitBatch, 2>& batches);

/// Rotation matrices of the quaternions, row-major.
void rotation_matrices(const FitBatch& batch, float (&matrix)[9][kFitLanes]);

/// For each lane: scale <- clamp(scale * J^(-gain / 3)), J = det(sum) * inverse_rest_determinant the local
/// volume ratio, taken within 1/8 to 8 (beyond that a neighborhood is crushed or turned inside out, and says
/// only which way to go); the scale stays within 1/1.3 to 1.3. Lanes with inverse_rest_determinant 0 keep
/// their scale.
void correct_volume(const FitBatch& batch, const float (&inverse_rest_determinant)[kFitLanes], float gain,
                    float (&scale)[kFitLanes]);

}  // namespace sinew
