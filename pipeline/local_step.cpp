// Second-order steps on the rotation group for the orthogonal Procrustes problem: with B = R^T S (S the sum
// and the guess, weighed), the derivative of trace(exp([w])^T B) at w = 0 is the axial part of B, its second
// derivative -(trace(P) I - P) with P the symmetric part of B. Steps are taken by Cayley's map, which needs
// no sine. All lanes run the same straight line of arithmetic. Quaternions are never normalised: a turn is a
// quotient, so that B may be a multiple of itself.
#include "pipeline/local_step.h"

#include <cstring>

namespace sinew {
namespace {

using Floats = Wide<float, kFitLanes>;
using Integers = Wide<int, kFitLanes>;

/// Newton doubles the digits each time; from a blended rotation two or three steps are the rule.
constexpr int kMostSteps = 8;

/// Squared radians. The step after one this small is below single precision.
constexpr float kSmallStep = 1e-7f;

/// A curvature is trusted when its determinant is above this, the neighborhood's size being one.
constexpr float kLeastCurvature = 1e-9f;

constexpr float kMostVolumeRatio = 8.0f;
constexpr float kMostScale = 1.3f;

struct WideMatrix {
  Floats at[3][3];
};

struct WideQuaternion {
  Floats x, y, z, w;
};

WideMatrix load_sum(const FitBatch& batch) {
  WideMatrix sum;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      sum.at[row][column] = loaded<Floats>(batch.sum[3 * row + column]);
  }
  return sum;
}

WideQuaternion load_rotation(const FitBatch& batch) {
  return {loaded<Floats>(batch.rotation[0]), loaded<Floats>(batch.rotation[1]),
          loaded<Floats>(batch.rotation[2]), loaded<Floats>(batch.rotation[3])};
}

Floats square_of(const WideQuaternion& q) {
  return q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
}

/// The rotation's matrix times the square of the quaternion's length.
inline void matrix_of(const WideQuaternion& q, WideMatrix& R) {
  const Floats x = 2.0f * q.x, y = 2.0f * q.y, z = 2.0f * q.z;
  const Floats xx = q.x * q.x, yy = q.y * q.y, ww = q.w * q.w;
  const Floats sum = ww + xx, difference = ww - xx, other_sum = q.z * q.z + yy,
               other_difference = yy - q.z * q.z;
  R.at[0][0] = sum - other_sum;
  R.at[1][1] = difference + other_difference;
  R.at[2][2] = difference - other_difference;
  const Floats xy = x * q.y, xz = x * q.z, yz = y * q.z;
  R.at[0][1] = xy - q.w * z;
  R.at[1][0] = xy + q.w * z;
  R.at[0][2] = xz + q.w * y;
  R.at[2][0] = xz - q.w * y;
  R.at[1][2] = yz - q.w * x;
  R.at[2][1] = yz + q.w * x;
}

void scale(const Floats& factor, WideMatrix& matrix) {
  for (auto& row : matrix.at) {
    for (Floats& entry : row) entry *= factor;
  }
}

/// B = R^T S.
inline void turned_back(const WideMatrix& R, const WideMatrix& S, WideMatrix& B) {
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      B.at[row][column] =
          R.at[0][row] * S.at[0][column] + R.at[1][row] * S.at[1][column] + R.at[2][row] * S.at[2][column];
    }
  }
}

struct WideVector {
  Floats x, y, z;
};

/// The turn that Newton's method wants: curvature^-1 slope, or a share of the slope where the curvature
/// points the wrong way (the slope never does).
inline void wanted_turn(const WideMatrix& B, WideVector& turn) {
  const WideVector slope = {B.at[2][1] - B.at[1][2], B.at[0][2] - B.at[2][0], B.at[1][0] - B.at[0][1]};
  const Floats a = B.at[1][1] + B.at[2][2];
  const Floats b = B.at[0][0] + B.at[2][2];
  const Floats c = B.at[0][0] + B.at[1][1];
  const Floats d = -0.5f * (B.at[0][1] + B.at[1][0]);
  const Floats e = -0.5f * (B.at[0][2] + B.at[2][0]);
  const Floats f = -0.5f * (B.at[1][2] + B.at[2][1]);
  const Floats cofactor_a = b * c - f * f;
  const Floats cofactor_c = a * b - d * d;
  const Floats cofactor_d = e * f - d * c;
  const Floats cofactor_e = d * f - b * e;
  const Floats cofactor_f = d * e - a * f;
  const Floats determinant = a * cofactor_a + d * cofactor_d + e * cofactor_e;
  const Integers curved = (a > 0.0f) & (cofactor_c > 0.0f) & (determinant > kLeastCurvature);
  const auto times_divisor = [&](const Floats& newton, const Floats& slope_alone) {
    return curved ? newton : slope_alone;
  };
  turn.x = times_divisor(cofactor_a * slope.x + cofactor_d * slope.y + cofactor_e * slope.z, slope.x);
  turn.y = times_divisor(cofactor_d * slope.x + (a * c - e * e) * slope.y + cofactor_f * slope.z, slope.y);
  turn.z = times_divisor(cofactor_e * slope.x + cofactor_f * slope.y + cofactor_c * slope.z, slope.z);
  // Beyond a radian the quadratic model says little: the longer, the less of it. One division for both cases.
  const Floats divisor = curved ? determinant : Floats{} + 1.0f;
  const Floats length = turn.x * turn.x + turn.y * turn.y + turn.z * turn.z;
  const Integers far = length > divisor * divisor;
  const Floats factor = (far ? divisor : Floats{} + 1.0f) / (far ? length : divisor);
  turn.x *= factor;
  turn.y *= factor;
  turn.z *= factor;
}

/// q <- q (1 + turn / 2), but for its length.
inline void apply(const WideVector& turn, WideQuaternion& q) {
  const Floats x = 0.5f * turn.x;
  const Floats y = 0.5f * turn.y;
  const Floats z = 0.5f * turn.z;
  q = {q.x + q.w * x + q.y * z - q.z * y, q.y + q.w * y + q.z * x - q.x * z,
       q.z + q.w * z + q.x * y - q.y * x, q.w - q.x * x - q.y * y - q.z * z};
}

/// The largest of the lanes.
float largest(const Floats& lanes) {
  float result = lanes[0];
  for (int lane = 1; lane < kFitLanes; ++lane) result = lanes[lane] > result ? lanes[lane] : result;
  return result;
}

/// 1 / sqrt(x) for x > 0 to single precision: a guess from the exponent, then Newton's method.
inline void inverse_root(const Floats& x, Floats& result) {
  Integers bits;
  std::memcpy(&bits, &x, sizeof bits);
  constexpr int bits_of_guess = 0x5f3759df;
  bits = bits_of_guess - (bits >> 1);
  std::memcpy(&result, &bits, sizeof result);
  for (int step = 0; step < 3; ++step) result = result * (1.5f - 0.5f * x * result * result);
}

/// Makes the entries' squares sum to one, or leaves a zero matrix as it is.
inline void scale_to_one(WideMatrix& matrix) {
  Floats squares = Floats{} + 1e-37f;
  for (const auto& row : matrix.at) {
    for (const Floats& entry : row) squares = squares + entry * entry;
  }
  Floats inverse;
  inverse_root(squares, inverse);
  scale(inverse, matrix);
}

/// 2^(factor log2 x) for x from 1/8 to 8 and small factors, to single precision.
void power(const Floats& x, float factor, Floats& result) {
  Integers bits;
  std::memcpy(&bits, &x, sizeof bits);
  // x = 2^exponent * mantissa, the mantissa from sqrt(1/2) to sqrt(2), where the series converges fast.
  constexpr int bits_of_root_half = 0x3f3504f3;
  const Integers exponent = (bits - bits_of_root_half) >> 23;
  const Integers mantissa_bits = bits - (exponent << 23);
  Floats mantissa;
  std::memcpy(&mantissa, &mantissa_bits, sizeof mantissa);
  const Floats t = (mantissa - 1.0f) / (mantissa + 1.0f);
  const Floats t2 = t * t;
  const Floats natural = 2.0f * t * (1.0f + t2 * (1.0f / 3.0f + t2 * (0.2f + t2 * (1.0f / 7.0f))));
  const Floats logarithm = natural + 0.69314718f * __builtin_convertvector(exponent, Floats);
  // e^y as the 16th power of e^(y/16): y / 16 is so small that a few terms do.
  const Floats y = (0.0625f * factor) * logarithm;
  Floats power = 1.0f + y * (1.0f + y * (0.5f + y * (1.0f / 6.0f + y * (1.0f / 24.0f))));
  for (int square = 0; square < 4; ++square) power = power * power;
  result = power;
}

void clamp(float low, float high, Floats& value) {
  value = value < low ? Floats{} + low : value;
  value = value > high ? Floats{} + high : value;
}

/// One step's arithmetic takes less time than its results take to arrive: kBatches fill each other's waits.
template <int kBatches>
void fit(FitBatch* batches) {
  WideMatrix S[kBatches], R[kBatches];
  WideQuaternion q[kBatches];
  for (int k = 0; k < kBatches; ++k) {
    S[k] = load_sum(batches[k]);
    scale_to_one(S[k]);
    q[k] = load_rotation(batches[k]);
    matrix_of(q[k], R[k]);
    const Floats unit = 1.0f / square_of(q[k]);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        Floats& entry = S[k].at[row][column];
        entry = unit * (entry + (kGuessCounts * unit) * R[k].at[row][column]);
      }
    }
  }
  for (int step = 0; step < kMostSteps; ++step) {
    Floats turned = {};
    for (int k = 0; k < kBatches; ++k) {
      WideMatrix B;
      WideVector turn;
      turned_back(R[k], S[k], B);
      wanted_turn(B, turn);
      apply(turn, q[k]);
      const Floats length = turn.x * turn.x + turn.y * turn.y + turn.z * turn.z;
      turned = length > turned ? length : turned;
    }
    if (largest(turned) < kSmallStep) break;
    for (int k = 0; k < kBatches; ++k) matrix_of(q[k], R[k]);
  }
  for (int k = 0; k < kBatches; ++k) {
    store(q[k].x, batches[k].rotation[0]);
    store(q[k].y, batches[k].rotation[1]);
    store(q[k].z, batches[k].rotation[2]);
    store(q[k].w, batches[k].rotation[3]);
  }
}

}  // namespace

void fit_rotations(FitBatch& batch) {
  fit<1>(&batch);
}

void fit_rotations(std::array<FitBatch, 2>& batches) {
  fit<2>(batches.data());
}

void rotation_matrices(const FitBatch& batch, float (&matrix)[9][kFitLanes]) {
  WideMatrix R;
  const WideQuaternion q = load_rotation(batch);
  matrix_of(q, R);
  scale(1.0f / square_of(q), R);
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) store(R.at[row][column], matrix[3 * row + column]);
  }
}

void correct_volume(const FitBatch& batch, const float (&inverse_rest_determinant)[kFitLanes], float gain,
                    float (&scale)[kFitLanes]) {
  const WideMatrix S = load_sum(batch);
  const Floats determinant = S.at[0][0] * (S.at[1][1] * S.at[2][2] - S.at[1][2] * S.at[2][1]) -
                             S.at[0][1] * (S.at[1][0] * S.at[2][2] - S.at[1][2] * S.at[2][0]) +
                             S.at[0][2] * (S.at[1][0] * S.at[2][1] - S.at[1][1] * S.at[2][0]);
  const Floats inverse = loaded<Floats>(inverse_rest_determinant);
  Floats ratio = determinant * inverse;
  clamp(1.0f / kMostVolumeRatio, kMostVolumeRatio, ratio);
  Floats factor;
  power(ratio, -gain / 3.0f, factor);
  const Floats before = loaded<Floats>(scale);
  Floats after = before * factor;
  clamp(1.0f / kMostScale, kMostScale, after);
  store(inverse > 0.0f ? after : before, scale);
}

}  // namespace sinew
