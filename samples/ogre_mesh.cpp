// The body is the zero set of a smooth union of round cones and ellipsoids. It is meshed by surface
// nets [Gibson 1998]: one vertex in each grid cell the surface passes through, one quad across each
// grid edge it cuts; the vertices are then spread evenly and pulled onto the zero set.
#include "samples/ogre_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>

namespace sinew::samples {
namespace {

using Eigen::Vector3d;

const Vector3d kSkin(0.33, 0.46, 0.22);
const Vector3d kBelly(0.52, 0.58, 0.34);
const Vector3d kCloth(0.27, 0.15, 0.08);
const Vector3d kIvory(0.86, 0.80, 0.64);
const Vector3d kEye(0.93, 0.78, 0.25);
const Vector3d kPupil(0.03, 0.02, 0.02);

/// Distance to a cone with spherical ends: radius `ra` at `a`, `rb` at `b`.
double round_cone(const Vector3d& p, const Vector3d& a, const Vector3d& b, double ra, double rb) {
  const Vector3d axis = b - a;
  const double length = axis.norm();
  const Vector3d along = axis / length;
  const double slope = (ra - rb) / length;
  const double stretch = std::sqrt(std::max(1.0 - slope * slope, 1e-12));
  const double t = (p - a).dot(along);
  const double r = (p - a - t * along).norm();
  // The cone's side is met where its normal points: behind `a`, beside the axis or beyond `b`.
  const double foot = std::clamp(t + r * slope / stretch, 0.0, length);
  return (p - a - foot * along).norm() - (ra + (rb - ra) * foot / length);
}

/// Close to the distance to an ellipsoid: exact on it and along its axes' directions nearby.
double ellipsoid(const Vector3d& p, const Vector3d& centre, const Vector3d& radii) {
  const Vector3d q = p - centre;
  const double k0 = q.cwiseQuotient(radii).norm();
  const double k1 = q.cwiseQuotient(radii.cwiseAbs2()).norm();
  return k1 < 1e-9 ? -radii.minCoeff() : k0 * (k0 - 1.0) / k1;
}

/// Union that rounds the seam over a width of `k` (cubic, so that curvature is continuous).
double blend(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - h * h * h * k / 6.0;
}

/// A ball that a limb's outline touches.
struct Ball {
  Vector3d centre;
  double radius;
};

/// Limb through a row of balls: a Catmull-Rom curve through centres and radii, in short cones that
/// share their ends, so that their union needs no rounding.
class Limb {
 public:
  Limb(std::initializer_list<Ball> given) {
    const std::vector<Ball> balls(given);
    const auto ball = [&](std::size_t i, int shift) {
      const int last = static_cast<int>(balls.size()) - 1;
      return balls[static_cast<std::size_t>(std::clamp(static_cast<int>(i) + shift, 0, last))];
    };
    for (std::size_t i = 0; i + 1 < balls.size(); ++i) {
      for (int piece = 0; piece < kPieces; ++piece) {
        const double t = static_cast<double>(piece) / kPieces;
        const std::array<double, 4> w = {0.5 * (-t + 2 * t * t - t * t * t), 0.5 * (2 - 5 * t * t + 3 * t * t * t),
                                         0.5 * (t + 4 * t * t - 3 * t * t * t), 0.5 * (-t * t + t * t * t)};
        Ball point{Vector3d::Zero(), 0.0};
        for (int k = 0; k < 4; ++k) {
          point.centre += w[k] * ball(i, k - 1).centre;
          point.radius += w[k] * ball(i, k - 1).radius;
        }
        balls_.push_back(point);
      }
    }
    balls_.push_back(balls.back());
  }

  double distance(const Vector3d& p) const {
    double d = 1e9;
    for (std::size_t i = 0; i + 1 < balls_.size(); ++i) {
      d = std::min(d, round_cone(p, balls_[i].centre, balls_[i + 1].centre, balls_[i].radius, balls_[i + 1].radius));
    }
    return d;
  }

 private:
  static constexpr int kPieces = 5;
  std::vector<Ball> balls_;
};

Vector3d mirrored(const Vector3d& p) { return {-p.x(), p.y(), p.z()}; }

/// One arm with its hand, on the left (+x) side.
double arm(const Vector3d& p) {
  static const Limb kArm = {{{0.235, 1.50, -0.01}, 0.103},
                       {{0.38, 1.468, -0.013}, 0.082},
                       {{0.52, 1.44, -0.015}, 0.068},
                       {{0.57, 1.43, -0.012}, 0.076},
                       {{0.63, 1.418, -0.01}, 0.081},
                       {{0.71, 1.402, -0.006}, 0.069},
                       {{0.80, 1.385, 0.0}, 0.050}};
  double d = kArm.distance(p);
  double hand = ellipsoid(p, {0.875, 1.371, 0.006}, {0.088, 0.040, 0.070});
  const std::array<std::array<Vector3d, 2>, 3> fingers = {{{{{0.915, 1.366, -0.046}, {1.000, 1.342, -0.074}}},
                                                           {{{0.930, 1.364, 0.006}, {1.028, 1.338, 0.008}}},
                                                           {{{0.915, 1.366, 0.058}, {0.998, 1.342, 0.090}}}}};
  for (const auto& finger : fingers) hand = blend(hand, round_cone(p, finger[0], finger[1], 0.0235, 0.0195), 0.022);
  hand = blend(hand, round_cone(p, {0.835, 1.372, 0.045}, {0.868, 1.362, 0.122}, 0.026, 0.021), 0.025);
  return blend(d, hand, 0.045);
}

/// One leg with its foot, on the left side.
double leg(const Vector3d& p) {
  static const Limb kLeg = {{{0.128, 0.92, 0.0}, 0.122},
                       {{0.145, 0.66, 0.010}, 0.098},
                       {{0.152, 0.52, 0.014}, 0.080},
                       {{0.154, 0.45, 0.002}, 0.078},
                       {{0.156, 0.36, -0.014}, 0.083},
                       {{0.157, 0.24, -0.018}, 0.072},
                       {{0.158, 0.12, -0.022}, 0.057}};
  double d = kLeg.distance(p);
  double foot = round_cone(p, {0.158, 0.062, -0.062}, {0.180, 0.050, 0.105}, 0.066, 0.056);
  for (const auto& [x, z, radius] : {std::array{0.132, 0.172, 0.040}, {0.185, 0.186, 0.037}, {0.233, 0.160, 0.033}}) {
    foot = blend(foot, (p - Vector3d(x, 0.034, z)).norm() - radius, 0.030);
  }
  d = blend(d, foot, 0.055);
  // A flat sole: cut by the floor, the edge rounded.
  return -blend(-d, p.y(), 0.025);
}

double trunk(const Vector3d& p) {
  double d = ellipsoid(p, {0.0, 1.13, 0.055}, {0.232, 0.225, 0.215});
  d = blend(d, ellipsoid(p, {0.0, 0.965, -0.005}, {0.205, 0.135, 0.158}), 0.10);
  d = blend(d, round_cone(p, {-0.12, 1.40, -0.005}, {0.12, 1.40, -0.005}, 0.163, 0.163), 0.14);
  d = blend(d, ellipsoid(p, {0.0, 1.475, -0.055}, {0.20, 0.125, 0.135}), 0.08);
  return blend(d, round_cone(p, {0.0, 1.52, -0.005}, {0.0, 1.68, 0.035}, 0.105, 0.095), 0.06);
}

/// Shorts: a little thicker than the hips and thighs, with a hem and a waistband.
double shorts(const Vector3d& p) {
  double d = ellipsoid(p, {0.0, 0.965, -0.005}, {0.222, 0.150, 0.178});
  const auto thigh = [](const Vector3d& q) {
    return round_cone(q, {0.134, 0.92, 0.0}, {0.160, 0.68, 0.01}, 0.142, 0.121);
  };
  d = blend(d, blend(thigh(p), thigh(mirrored(p)), 0.06), 0.04);
  const double below_waist = p.y() - 1.0;
  const double above_hem = 0.735 - p.y();
  return -blend(-d, -std::max(below_waist, above_hem), 0.04);
}

double eyes(const Vector3d& p) {
  const Vector3d q(std::abs(p.x()), p.y(), p.z());
  return (q - Vector3d(0.046, 1.765, 0.152)).norm() - 0.027;
}

double tusks(const Vector3d& p) {
  const Vector3d q(std::abs(p.x()), p.y(), p.z());
  return round_cone(q, {0.050, 1.662, 0.166}, {0.064, 1.728, 0.200}, 0.0235, 0.0135);
}

double head(const Vector3d& p) {
  const Vector3d q(std::abs(p.x()), p.y(), p.z());
  double d = ellipsoid(p, {0.0, 1.765, 0.045}, {0.115, 0.145, 0.132});
  d = blend(d, ellipsoid(p, {0.0, 1.675, 0.095}, {0.108, 0.066, 0.092}), 0.05);
  d = blend(d, round_cone(q, {0.0, 1.808, 0.158}, {0.068, 1.812, 0.132}, 0.028, 0.024), 0.03);
  d = blend(d, round_cone(p, {0.0, 1.775, 0.165}, {0.0, 1.735, 0.203}, 0.020, 0.032), 0.025);
  d = blend(d, round_cone(q, {0.100, 1.755, 0.030}, {0.215, 1.800, -0.010}, 0.040, 0.017), 0.025);
  d = blend(d, eyes(p), 0.008);
  return blend(d, tusks(p), 0.012);
}

double body(const Vector3d& p) {
  // Legs meet each other by a plain union: a rounded one would grow a web between the thighs.
  double d = std::min(leg(p), leg(mirrored(p)));
  d = blend(d, trunk(p), 0.05);
  d = blend(d, std::min(arm(p), arm(mirrored(p))), 0.09);
  d = blend(d, head(p), 0.05);
  return blend(d, shorts(p), 0.022);
}

Vector3d gradient(const Vector3d& p) {
  constexpr double h = 1e-5;
  Vector3d g;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3d step = h * Vector3d::Unit(axis);
    g[axis] = (body(p + step) - body(p - step)) / (2.0 * h);
  }
  return g;
}

Vector3d colour(const Vector3d& p) {
  if (eyes(p) < 0.004) {
    const Vector3d q(std::abs(p.x()), p.y(), p.z());
    return (q - Vector3d(0.044, 1.763, 0.179)).norm() < 0.014 ? kPupil : kEye;
  }
  const double front = std::clamp((p.z() - 0.06) / 0.10, 0.0, 1.0);
  const double on_belly = std::clamp(1.0 - (p - Vector3d(0.0, 1.15, 0.2)).norm() / 0.28, 0.0, 1.0);
  Vector3d result = kSkin + (kBelly - kSkin) * front * std::min(1.0, 2.0 * on_belly);
  // Over about one edge length: a hard change between vertices would show their zigzag.
  result += (kCloth - result) * std::clamp((0.008 - shorts(p)) / 0.012, 0.0, 1.0);
  if (p.y() > 1.676) result += (kIvory - result) * std::clamp((0.006 - tusks(p)) / 0.008, 0.0, 1.0);
  return result;
}

/// The sampling grid and the surface net on it.
class SurfaceNet {
 public:
  SurfaceNet(const Vector3d& low, const Vector3d& high, double cell) : low_(low), cell_(cell) {
    for (int axis = 0; axis < 3; ++axis) count_[axis] = static_cast<int>((high[axis] - low[axis]) / cell) + 2;
    values_.resize(static_cast<std::size_t>(count_[0]) * count_[1] * count_[2]);
    for (int k = 0; k < count_[2]; ++k)
      for (int j = 0; j < count_[1]; ++j)
        for (int i = 0; i < count_[0]; ++i) values_[at(i, j, k)] = body(corner(i, j, k));
    place_vertices();
    join_quads();
  }

  std::vector<Vector3d> vertices;
  std::vector<std::array<int, 4>> quads;  ///< counter-clockwise from outside

 private:
  std::size_t at(int i, int j, int k) const {
    return (static_cast<std::size_t>(k) * count_[1] + j) * count_[0] + i;
  }
  Vector3d corner(int i, int j, int k) const { return low_ + cell_ * Vector3d(i, j, k); }

  void place_vertices() {
    vertex_of_cell_.assign(values_.size(), -1);
    for (int k = 0; k + 1 < count_[2]; ++k)
      for (int j = 0; j + 1 < count_[1]; ++j)
        for (int i = 0; i + 1 < count_[0]; ++i) {
          Vector3d sum = Vector3d::Zero();
          int cuts = 0;
          for (int axis = 0; axis < 3; ++axis)
            for (int side = 0; side < 4; ++side) {
              std::array<int, 3> a = {i, j, k};
              a[(axis + 1) % 3] += side & 1;
              a[(axis + 2) % 3] += side >> 1;
              std::array<int, 3> b = a;
              ++b[axis];
              const double va = values_[at(a[0], a[1], a[2])];
              const double vb = values_[at(b[0], b[1], b[2])];
              if ((va < 0.0) == (vb < 0.0)) continue;
              const double t = va / (va - vb);
              sum += (1.0 - t) * corner(a[0], a[1], a[2]) + t * corner(b[0], b[1], b[2]);
              ++cuts;
            }
          if (cuts == 0) continue;
          vertex_of_cell_[at(i, j, k)] = static_cast<int>(vertices.size());
          vertices.push_back(sum / cuts);
        }
  }

  void join_quads() {
    for (int k = 1; k + 1 < count_[2]; ++k)
      for (int j = 1; j + 1 < count_[1]; ++j)
        for (int i = 1; i + 1 < count_[0]; ++i)
          for (int axis = 0; axis < 3; ++axis) {
            std::array<int, 3> next = {i, j, k};
            ++next[axis];
            const bool inside = values_[at(i, j, k)] < 0.0;
            if (inside == (values_[at(next[0], next[1], next[2])] < 0.0)) continue;
            const auto cell = [&](int du, int dv) {
              std::array<int, 3> c = {i, j, k};
              c[(axis + 1) % 3] -= du;
              c[(axis + 2) % 3] -= dv;
              return vertex_of_cell_[at(c[0], c[1], c[2])];
            };
            std::array<int, 4> quad = {cell(1, 1), cell(0, 1), cell(0, 0), cell(1, 0)};
            if (!inside) std::reverse(quad.begin(), quad.end());
            quads.push_back(quad);
          }
  }

  Vector3d low_;
  double cell_;
  std::array<int, 3> count_{};
  std::vector<double> values_;
  std::vector<int> vertex_of_cell_;
};

/// Spreads the vertices: each moves half-way to the mean of its quad neighbours, then back onto the
/// surface along the gradient. Rounds of it even the edges out without shrinking the body.
void relax(SurfaceNet& net, int rounds) {
  std::vector<Vector3d> sum(net.vertices.size());
  std::vector<int> count(net.vertices.size());
  for (int round = 0; round < rounds; ++round) {
    std::fill(sum.begin(), sum.end(), Vector3d::Zero());
    std::fill(count.begin(), count.end(), 0);
    for (const auto& quad : net.quads)
      for (int side = 0; side < 4; ++side) {
        sum[quad[side]] += net.vertices[quad[(side + 1) % 4]];
        ++count[quad[side]];
      }
    for (std::size_t v = 0; v < net.vertices.size(); ++v) {
      Vector3d& p = net.vertices[v];
      p = 0.5 * (p + sum[v] / count[v]);
      for (int step = 0; step < 2; ++step) {
        const Vector3d g = gradient(p);
        p -= body(p) / std::max(g.squaredNorm(), 0.05) * g;
      }
    }
  }
}

}  // namespace

ColouredMesh make_ogre(double cell) {
  const double reach = 1.08;
  SurfaceNet net({-reach, -3.0 * cell, -0.27}, {reach, 1.95, 0.33}, cell);
  relax(net, 12);
  ColouredMesh result;
  result.mesh.positions.resize(static_cast<Eigen::Index>(net.vertices.size()), 3);
  for (std::size_t v = 0; v < net.vertices.size(); ++v) {
    result.mesh.positions.row(static_cast<Eigen::Index>(v)) = net.vertices[v].transpose();
    result.colours.push_back(colour(net.vertices[v]));
  }
  for (const auto& q : net.quads) {
    // Cut along the shorter diagonal: flatter triangles.
    const double d02 = (net.vertices[q[0]] - net.vertices[q[2]]).norm();
    const double d13 = (net.vertices[q[1]] - net.vertices[q[3]]).norm();
    if (d02 <= d13) {
      result.mesh.triangles.push_back({q[0], q[1], q[2]});
      result.mesh.triangles.push_back({q[0], q[2], q[3]});
    } else {
      result.mesh.triangles.push_back({q[1], q[2], q[3]});
      result.mesh.triangles.push_back({q[1], q[3], q[0]});
    }
  }
  return result;
}

}  // namespace sinew::samples
