#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "solver/laplacian.h"

/// Small and large graphs made in code, for the tests of solver/.
namespace sinew::graphs {

/// A graph in space, some of whose nodes are held.
struct Body {
  Graph graph;
  Field3 positions;
  std::vector<char> pinned;  ///< by node
};

/// n nodes on a line, one apart; the ends are pinned unless n < 3, then the first.
inline Body path(int n) {
  Body body;
  std::vector<Edge> edges;
  for (int i = 0; i + 1 < n; ++i) edges.push_back({i, i + 1, 1.0});
  body.graph = make_graph(n, edges);
  body.positions.setZero(n, 3);
  for (int i = 0; i < n; ++i) body.positions(i, 0) = i;
  body.pinned.assign(static_cast<std::size_t>(n), 0);
  body.pinned.front() = 1;
  if (n > 2) body.pinned.back() = 1;
  return body;
}

/// nx x ny nodes on a gently curved sheet, joined along rows, columns and one diagonal, as a triangle
/// mesh would be; the first column is pinned.
inline Body sheet(int nx, int ny) {
  Body body;
  std::vector<Edge> edges;
  const auto node = [ny](int i, int j) { return i * ny + j; };
  body.positions.resize(nx * ny, 3);
  body.pinned.assign(static_cast<std::size_t>(nx * ny), 0);
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j) {
      body.positions.row(node(i, j)) << i, j, 0.1 * nx * std::sin(4.0 * i / nx) * std::cos(3.0 * j / ny);
      if (i == 0) body.pinned[node(i, j)] = 1;
      if (i + 1 < nx) edges.push_back({node(i, j), node(i + 1, j), 1.0});
      if (j + 1 < ny) edges.push_back({node(i, j), node(i, j + 1), 1.0});
      if (i + 1 < nx && j + 1 < ny) edges.push_back({node(i, j), node(i + 1, j + 1), 1.0});
    }
  body.graph = make_graph(nx * ny, edges);
  return body;
}

/// A tree: `arms` paths of `length` nodes from one middle node, pinned at every tip.
inline Body star(int arms, int length) {
  Body body;
  std::vector<Edge> edges;
  const int n = 1 + arms * length;
  body.positions.setZero(n, 3);
  body.pinned.assign(static_cast<std::size_t>(n), 0);
  for (int arm = 0; arm < arms; ++arm)
    for (int k = 0; k < length; ++k) {
      const int own = 1 + arm * length + k;
      edges.push_back({k == 0 ? 0 : own - 1, own, 1.0});
      const double angle = 2 * std::numbers::pi * arm / arms;
      body.positions.row(own) << (k + 1) * std::cos(angle), (k + 1) * std::sin(angle), 0.3 * k;
      if (k + 1 == length) body.pinned[own] = 1;
    }
  body.graph = make_graph(n, edges);
  return body;
}

/// A binary tree of `levels` levels, pinned at the root and at every 32nd leaf; a child is half as far from
/// its parent as that from its own, so that the twigs crowd.
inline Body tree(int levels) {
  Body body;
  std::vector<Edge> edges;
  const int n = (1 << levels) - 1;
  body.positions.setZero(n, 3);
  body.pinned.assign(static_cast<std::size_t>(n), 0);
  body.pinned[0] = 1;
  for (int leaf = n / 2; leaf < n; leaf += 32) body.pinned[leaf] = 1;
  for (int node = 1; node < n; ++node) {
    const int parent = (node - 1) / 2, depth = static_cast<int>(std::log2(node + 1));
    edges.push_back({parent, node, 1.0});
    body.positions.row(node) = body.positions.row(parent);
    body.positions(node, depth % 3) += (node % 2 == 0 ? 1 : -1) * std::pow(0.7, depth);
  }
  body.graph = make_graph(n, edges);
  return body;
}

/// A path of `teeth` nodes, one apart, each with a path of `length` nodes hanging from it; the first is
/// pinned.
inline Body comb(int teeth, int length) {
  Body body;
  std::vector<Edge> edges;
  const int n = teeth * (1 + length);
  body.positions.setZero(n, 3);
  body.pinned.assign(static_cast<std::size_t>(n), 0);
  body.pinned[0] = 1;
  for (int tooth = 0; tooth < teeth; ++tooth)
    for (int k = 0; k <= length; ++k) {
      const int node = tooth * (1 + length) + k;
      body.positions.row(node) << tooth, k, 0.01 * k * k;
      if (k > 0)
        edges.push_back({node - 1, node, 1.0});
      else if (tooth > 0)
        edges.push_back({node - 1 - length, node, 1.0});
    }
  body.graph = make_graph(n, edges);
  return body;
}

/// One node joined to `arms` others that are joined to nothing else, the last and every tenth of them pinned.
inline Body hub(int arms) {
  Body body;
  std::vector<Edge> edges;
  body.positions.setZero(arms + 1, 3);
  body.pinned.assign(static_cast<std::size_t>(arms) + 1, 0);
  for (int arm = 1; arm <= arms; ++arm) {
    edges.push_back({0, arm, 1.0});
    body.positions.row(arm) << std::cos(arm), std::sin(arm), std::cos(1.7 * arm);
    body.pinned[arm] = arm % 10 == 0 || arm == arms ? 1 : 0;
  }
  body.graph = make_graph(arms + 1, edges);
  return body;
}

/// `count` copies of `part` on a cubic grid, apart by less than its size, that share nothing.
inline Body scattered(const Body& part, int count) {
  Body body;
  std::vector<Edge> edges;
  const int size = part.graph.node_count();
  const int side = static_cast<int>(std::ceil(std::cbrt(count)));
  const Eigen::RowVector3d step =
      0.6 * (part.positions.colwise().maxCoeff() - part.positions.colwise().minCoeff()) +
      Eigen::RowVector3d::Constant(0.1);
  body.positions.resize(count * size, 3);
  for (int copy = 0; copy < count; ++copy) {
    const Eigen::RowVector3d place(copy % side, copy / side % side, copy / side / side);
    body.positions.middleRows(copy * size, size) = part.positions.rowwise() + place.cwiseProduct(step);
    body.pinned.insert(body.pinned.end(), part.pinned.begin(), part.pinned.end());
    for (int i = 0; i < size; ++i)
      for (int j : part.graph.neighbors_of(i))
        if (i < j) edges.push_back({copy * size + i, copy * size + j, 1.0});
  }
  body.graph = make_graph(count * size, edges);
  return body;
}

/// Two bodies side by side that share nothing.
inline Body beside(const Body& left, const Body& right) {
  const int shift = left.graph.node_count();
  std::vector<Edge> edges;
  for (const Body* part : {&left, &right})
    for (int i = 0; i < part->graph.node_count(); ++i)
      for (int k = part->graph.offsets[i]; k < part->graph.offsets[i + 1]; ++k)
        if (const int j = part->graph.neighbors[k]; i < j) {
          const int base = part == &right ? shift : 0;
          edges.push_back({base + i, base + j, part->graph.weights[k]});
        }
  Body body;
  body.graph = make_graph(shift + right.graph.node_count(), edges);
  body.positions.resize(body.graph.node_count(), 3);
  body.positions << left.positions, right.positions;
  body.pinned = left.pinned;
  body.pinned.insert(body.pinned.end(), right.pinned.begin(), right.pinned.end());
  return body;
}

/// Whether a point is inside; the shapes here fit into [-1, 1]^3.
using Shape = std::function<bool(const Eigen::Vector3d&)>;

struct Capsule {
  Eigen::Vector3d a, b;
  double radius;
  bool holds(const Eigen::Vector3d& x) const {
    const Eigen::Vector3d axis = b - a;
    const double t = std::clamp((x - a).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
    return (x - a - t * axis).squaredNorm() < radius * radius;
  }
};

inline bool ball(const Eigen::Vector3d& x) {
  return x.squaredNorm() < 1;
}

inline bool dumbbell(const Eigen::Vector3d& x) {
  const Eigen::Vector3d end(0.6, 0, 0);
  return (x - end).norm() < 0.38 || (x + end).norm() < 0.38 || Capsule{-end, end, 0.12}.holds(x);
}

/// A standing figure: trunk, head, two arms with three fingers each, two legs close to each other.
inline const std::vector<Capsule>& figure_limbs() {
  static const std::vector<Capsule> limbs = [] {
    std::vector<Capsule> all = {{{0, -0.05, 0}, {0, 0.35, 0}, 0.17}, {{0, 0.5, 0}, {0, 0.78, 0}, 0.13}};
    for (const double side : {-1.0, 1.0}) {
      all.push_back({{side * 0.15, 0.42, 0}, {side * 0.5, 0.42, 0}, 0.07});
      all.push_back({{side * 0.5, 0.42, 0}, {side * 0.8, 0.42, 0.1}, 0.055});
      for (const double finger : {-1.0, 0.0, 1.0})
        all.push_back(
            {{side * 0.82, 0.42, 0.1 + 0.02 * finger}, {side * 0.97, 0.42, 0.1 + 0.06 * finger}, 0.022});
      all.push_back({{side * 0.11, -0.05, 0}, {side * 0.12, -0.5, 0}, 0.1});
      all.push_back({{side * 0.12, -0.5, 0}, {side * 0.12, -0.95, 0}, 0.07});
    }
    return all;
  }();
  return limbs;
}
inline bool figure(const Eigen::Vector3d& x) {
  for (const Capsule& limb : figure_limbs())
    if (limb.holds(x)) return true;
  return false;
}
/// Inside the joint balls of the figure: the ends of its limbs.
inline bool figure_joint(const Eigen::Vector3d& x) {
  for (const Capsule& limb : figure_limbs())
    if ((x - limb.a).norm() < 0.5 * limb.radius || (x - limb.b).norm() < 0.5 * limb.radius) return true;
  return false;
}
inline bool far_out(const Eigen::Vector3d& x) {
  return std::abs(x[0]) > 0.85;
}

/// Node numbers of a body-centred cubic lattice. Places have doubled coordinates: all even or all odd.
class BccNumbers {
 public:
  explicit BccNumbers(int reach) : reach_(reach), side_(reach + 2) {
    numbers_.assign(2 * static_cast<std::size_t>(side_) * side_ * side_, -1);
  }
  int& at(int i, int j, int k) {
    const auto cell = [this](int c) { return static_cast<std::size_t>((c + reach_ + 2) / 2); };
    return numbers_[2 * ((cell(i) * side_ + cell(j)) * side_ + cell(k)) + static_cast<std::size_t>(i & 1)];
  }

 private:
  int reach_;
  std::size_t side_;
  std::vector<int> numbers_;
};

/// Nodes of a body-centred cubic lattice inside a shape: 14 neighbors inside, as a volume graph has.
/// `about` nodes, pinned where `held` says.
inline Body bcc_body(const Shape& inside, int about, const Shape& held) {
  // Probe points first, to learn the volume; the lattice has two nodes per cube.
  constexpr int kProbe = 60;
  int hits = 0;
  for (int i = 0; i < kProbe * kProbe * kProbe; ++i) {
    const Eigen::Vector3d x(i % kProbe, i / kProbe % kProbe, i / kProbe / kProbe);
    hits += inside((x.array() + 0.5).matrix() * (2.0 / kProbe) - Eigen::Vector3d::Ones()) ? 1 : 0;
  }
  const double cube = std::cbrt(2 * 8.0 * hits / (kProbe * kProbe * kProbe) / about);
  const int reach = 2 * (static_cast<int>(1 / cube) + 2);

  BccNumbers number(reach);
  std::vector<std::array<int, 3>> places;
  for (int i = -reach; i <= reach; ++i)
    for (int j = -reach + ((i ^ reach) & 1); j <= reach; j += 2)
      for (int k = -reach + ((i ^ reach) & 1); k <= reach; k += 2)
        if (inside(Eigen::Vector3d(i, j, k) * (cube / 2))) {
          number.at(i, j, k) = static_cast<int>(places.size());
          places.push_back({i, j, k});
        }
  std::vector<Edge> edges;
  const auto join = [&](int own, int i, int j, int k) {
    if (const int other = number.at(i, j, k); other >= 0) edges.push_back({own, other, 1.0});
  };
  Body body;
  const int n = static_cast<int>(places.size());
  body.positions.resize(n, 3);
  body.pinned.assign(static_cast<std::size_t>(n), 0);
  for (int node = 0; node < n; ++node) {
    const auto [i, j, k] = places[node];
    const Eigen::Vector3d x = Eigen::Vector3d(i, j, k) * (cube / 2);
    body.positions.row(node) = x.transpose();
    body.pinned[node] = held(x) ? 1 : 0;
    for (const int s : {-1, 1})
      for (const int t : {-1, 1}) join(node, i + 1, j + s, k + t);
    join(node, i + 2, j, k);
    join(node, i, j + 2, k);
    join(node, i, j, k + 2);
  }
  body.graph = make_graph(n, edges);
  return body;
}

inline Body bcc_figure(int about) {
  return bcc_body(figure, about, figure_joint);
}
inline Body bcc_dumbbell(int about) {
  return bcc_body(dumbbell, about, far_out);
}
inline Body bcc_ball(int about) {
  return bcc_body(ball, about, far_out);
}

/// Shapes that are no volumes: thin, branching, in pieces, bare surfaces.
/// Held at one end, a chain of n nodes has a condition number near n^2: longer ribbons than these are beyond
/// single precision.
inline std::vector<std::pair<std::string, Body>> awkward_bodies() {
  Body small_comb = comb(100, 30);
  small_comb.positions *= 0.05;
  return {{"chain", path(30000)},
          {"ribbon", sheet(500, 2)},
          {"narrow band", sheet(500, 12)},
          {"bare surface", sheet(200, 200)},
          {"star of chains", star(60, 500)},
          {"hub", hub(20000)},
          {"tree", tree(14)},
          {"comb", comb(300, 60)},
          {"pairs", scattered(path(3), 8000)},
          {"short chains", scattered(path(9), 3000)},
          {"small sheets", scattered(sheet(5, 5), 900)},
          {"small balls", scattered(bcc_ball(150), 150)},
          {"single nodes", scattered(path(2), 20000)},
          {"surface and crumbs", beside(sheet(150, 150), scattered(path(3), 6000))},
          {"body and comb", beside(bcc_figure(20000), small_comb)}};
}

/// A body bent: the equations of its free nodes, and for every edge the vector it wants.
struct Problem {
  LinearSystem system;  ///< over the free nodes
  Field3 targets;       ///< one row per entry of system.graph.neighbors: the wanted x_i - x_j
  Field3 beta;          ///< n x 3: what the pinned neighbors ask for
  Columns b;            ///< n x 3: beta + sum of w * target
};

inline Eigen::Matrix3d bend(const Eigen::RowVector3d& x, double size) {
  return Eigen::AngleAxisd(1.2 * x[0] / size, Eigen::Vector3d(0.3, 1, 0.2).normalized()).toRotationMatrix();
}

/// How the free nodes of a problem follow each other.
enum class Order {
  breadth_first,
  as_made  ///< of a body-centred lattice: line after line, layer after layer
};

/// Bends `body` about an axis, more the further out along x; every edge turns by the mean of its ends'
/// rotations, and pinned nodes are moved by theirs.
inline Problem bent(const Body& body, Order order = Order::breadth_first) {
  const int all = body.graph.node_count();
  std::vector<int> free_nodes;
  for (int node = 0; node < all; ++node)
    if (!body.pinned[node]) free_nodes.push_back(node);
  std::vector<int> nodes = free_nodes;
  if (order == Order::breadth_first) {
    nodes.clear();
    for (int k : breadth_first_order(induced_subgraph(body.graph, free_nodes)))
      nodes.push_back(free_nodes[k]);
  }

  const double size = body.positions.cwiseAbs().maxCoeff();
  const auto place = [&](int node) -> Eigen::Vector3d { return body.positions.row(node).transpose(); };
  std::vector<Eigen::Matrix3d> turns;
  for (int node = 0; node < all; ++node) turns.push_back(bend(body.positions.row(node), size));
  const auto turn = [&](int node) -> const Eigen::Matrix3d& { return turns[node]; };
  const auto target = [&](int i, int j) -> Eigen::RowVector3d {
    return (0.5 * (turn(i) + turn(j)) * (place(i) - place(j))).transpose();
  };

  Problem problem;
  problem.system.graph = induced_subgraph(body.graph, nodes);
  const Graph& graph = problem.system.graph;
  const int n = graph.node_count();
  problem.system.anchor.setZero(n);
  problem.system.rest_positions.resize(n, 3);
  problem.beta.setZero(n, 3);
  problem.targets.resize(static_cast<Eigen::Index>(graph.neighbors.size()), 3);
  for (int i = 0; i < n; ++i) {
    problem.system.rest_positions.row(i) = body.positions.row(nodes[i]);
    for (int k = body.graph.offsets[nodes[i]]; k < body.graph.offsets[nodes[i] + 1]; ++k) {
      const int held = body.graph.neighbors[k];
      if (!body.pinned[held]) continue;
      problem.system.anchor[i] += body.graph.weights[k];
      problem.beta.row(i) +=
          body.graph.weights[k] * ((turn(held) * place(held)).transpose() + target(nodes[i], held));
    }
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
      problem.targets.row(k) = target(nodes[i], nodes[graph.neighbors[k]]);
  }
  problem.b = problem.beta;
  for (int i = 0; i < n; ++i)
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
      problem.b.row(i) += graph.weights[k] * problem.targets.row(k);
  return problem;
}

}  // namespace sinew::graphs
