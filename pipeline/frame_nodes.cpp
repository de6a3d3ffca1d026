#include "pipeline/frame_nodes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <type_traits>
#include <utility>

#include "solver/wide.h"

namespace sinew {
namespace {

/// A neighborhood flatter than this share of an even one has no volume to speak of.
constexpr double kFlat = 1e-3;

/// What an edge of a run may be off, in its own lengths.
constexpr double kStraight = 1e-6;

/// Links, some eight rows, by which the passes over the edges tell the caches what they will want: the
/// records of a large body do not fit the second level. As many entries behind the last link make that safe.
constexpr int kAhead = 112;
static_assert(kAhead % kLinkGroup == 0);

using Vector4 = Wide<float, 4>;
using Vector16 = Wide<float, 16>;

Eigen::Vector4f with_zero(const Eigen::Vector3d& vector) {
  Eigen::Vector4f four = Eigen::Vector4f::Zero();
  four.head<3>() = vector.cast<float>();
  return four;
}

inline const Vector16& as_vector(const NodeRecord& record) {
  return reinterpret_cast<const Vector16&>(record);
}

/// Four numbers in every quarter. Written number by number, where GCC sees that the load itself can do it.
template <typename Vector, typename Four>
inline Vector in_all_quarters(const Four& v) {
  if constexpr (kIsHalved<Vector>) {
    const auto half = in_all_quarters<typename Vector::Half>(v);
    return {half, half};
  } else if constexpr (sizeof(Vector) == sizeof(Four)) {
    return v;
  } else if constexpr (sizeof(Vector) == 2 * sizeof(Four)) {
    return Vector{v[0], v[1], v[2], v[3], v[0], v[1], v[2], v[3]};
  } else {
    return Vector{v[0], v[1], v[2], v[3], v[0], v[1], v[2], v[3],
                  v[0], v[1], v[2], v[3], v[0], v[1], v[2], v[3]};
  }
}

/// Of numbers that are in all quarters number `first` in all of the first quarter, and so on. No number
/// leaves its quarter, which would cost twice as much.
template <int first, typename Vector>
inline Vector each_in_its_quarter(const Vector& v) {
  constexpr int a = first, b = a + 5, c = b + 5, d = c + 5;
  if constexpr (kIsHalved<Vector>) {
    constexpr int second = first + static_cast<int>(sizeof(v.low) / sizeof(Vector4));
    return {each_in_its_quarter<first>(v.low), each_in_its_quarter<second>(v.high)};
  } else if constexpr (sizeof(Vector) == sizeof(Vector4)) {
    return __builtin_shufflevector(v, v, a, a, a, a);
  } else if constexpr (sizeof(Vector) == 2 * sizeof(Vector4)) {
    return __builtin_shufflevector(v, v, a, a, a, a, b, b, b, b);
  } else {
    return __builtin_shufflevector(v, v, a, a, a, a, b, b, b, b, c, c, c, c, d, d, d, d);
  }
}

inline Vector4 zero_behind_three(const Vector4& v) {
  return __builtin_shufflevector(v, Vector4{}, 0, 1, 2, 4);
}

/// Columns times coordinates; the fourth number means nothing.
inline Vector4 turned(const Vector16& columns, const Eigen::Vector4f& coordinates) {
  return coordinates[0] * quarter<0>(columns) + coordinates[1] * quarter<1>(columns) +
         coordinates[2] * quarter<2>(columns);
}

/// The fourth numbers of the columns; the fourth of these means nothing.
inline Vector4 positions_of(const Vector16& v) {
  const Vector4 two = __builtin_shufflevector(quarter<0>(v), quarter<1>(v), 3, 7, 3, 7);
  return __builtin_shufflevector(two, quarter<2>(v), 0, 1, 7, 7);
}

inline Eigen::Vector4f as_eigen(const Vector4& v) {
  Eigen::Vector4f four;
  store(v, four.data());
  return four;
}

/// From L of the records, the residual but for what the rest's own L adds.
inline Vector4 residual_of(const NodeRecord& own, const Vector16& differences) {
  return positions_of(differences) - 0.5f * turned(differences, own.rest);
}

/// Calls group(k) for the links of a slot, k the first of each group.
template <typename Value, typename Group>
inline void for_each_group(const FrameNodes& nodes, int slot, const Value* values, const Group& group) {
  const int end = nodes.offsets[slot + 1];
  for (int k = nodes.offsets[slot]; k < end; k += kLinkGroup) {
    for (int link = 0; link < kLinkGroup; ++link)
      __builtin_prefetch(&nodes.linked(values, k + kAhead + link));
    group(k);
  }
}

/// `loose`: the slot is that one of those outside runs.
template <bool kUniform>
inline Vector4 residual_row(const FrameNodes& nodes, int slot, int loose) {
  const NodeRecord* const records = nodes.records.data();
  const auto own = loaded<Vector16>(records[slot].column[0].data());
  const auto at = [&](int link) -> const Vector16& { return as_vector(nodes.linked(records, link)); };
  const Vector16 twice = own + own, four_times = twice + twice;
  Vector16 differences{};
  for_each_group(nodes, slot, records, [&](int k) {
    if constexpr (kUniform) {
      differences += four_times - ((at(k) + at(k + 1)) + (at(k + 2) + at(k + 3)));
    } else {
      for (int link = 0; link < kLinkGroup; ++link)
        differences += (own - at(k + link)) * nodes.weights[k + link];
    }
  });
  return zero_behind_three(residual_of(records[slot], differences) +
                           turned(own, nodes.half_rest_differences[loose]));
}

/// Calls visit(slot, residual) for slots of a run. What two slots that follow each other have in common is
/// summed once.
template <typename Visit>
inline void residuals_in_run(const FrameNodes& nodes, const LatticeRun& run, int first, int end,
                             const Visit& visit) {
  const auto [s0, s1, s2, s3] = run.singles;
  const auto [p0, p1, p2, p3] = run.pairs;
  const NodeRecord* const records = nodes.records.data();
  const auto at = [&](int slot) { return loaded<Vector16>(records[slot].column[0].data()); };
  const auto four = [&](int slot) {
    return (at(slot + p0) + at(slot + p1)) + (at(slot + p2) + at(slot + p3));
  };
  Vector16 shared = four(first), before = at(first - 1), own = at(first);
  for (int slot = first; slot < end; ++slot) {
    const Vector16 next = four(slot + 1), behind = at(slot + 1);
    const Vector16 twice = own + own, four_times = twice + twice;
    const Vector16 differences =
        ((four_times - shared) + (four_times - next)) +
        (((twice - (at(slot + s0) + at(slot + s3))) + (twice - (at(slot + s1) + at(slot + s2)))) +
         (twice - (before + behind)));
    visit(slot, zero_behind_three(residual_of(records[slot], differences)));
    shared = next;
    before = own;
    own = behind;
  }
}

/// Calls visit(slot, residual) for free slots [first, end).
template <typename Visit>
void for_each_residual(const FrameNodes& nodes, int first, int end, const Visit& visit) {
  ascend_parts(
      nodes.runs, first, end,
      [&](int begin, int stop, int before) {
        if (nodes.weights.empty()) {
          for (int slot = begin; slot < stop; ++slot)
            visit(slot, residual_row<true>(nodes, slot, slot - before));
        } else {
          for (int slot = begin; slot < stop; ++slot)
            visit(slot, residual_row<false>(nodes, slot, slot - before));
        }
      },
      [&](const LatticeRun& run, int begin, int stop) { residuals_in_run(nodes, run, begin, stop, visit); });
}

/// The columns of sum_j w e' e^T of one node, each with a number more.
struct EdgeSum {
  Vector4 columns[3];
};

template <bool kUniform>
inline EdgeSum sum_row_edges(const FrameNodes& nodes, int slot) {
  const NodePlace* const places = nodes.places.data();
  const auto spread = [](const Eigen::Vector4f& v) {
    return in_all_quarters<Vector16>(loaded<Vector4>(v.data()));
  };
  const Vector16 own_rest = spread(places[slot].rest), own_now = spread(places[slot].now);
  Vector16 sum{};
  for_each_group(nodes, slot, places, [&](int k) {
    for (int link = 0; link < kLinkGroup; ++link) {
      const NodePlace& neighbor = nodes.linked(places, k + link);
      Vector16 edge_now = own_now - spread(neighbor.now);
      if constexpr (!kUniform) edge_now *= nodes.weights[k + link];
      sum += each_in_its_quarter<0>(own_rest - spread(neighbor.rest)) * edge_now;
    }
  });
  return {{quarter<0>(sum), quarter<1>(sum), quarter<2>(sum)}};
}

/// Calls body with the three axes as constants, which places in a record must be.
template <typename Body>
void with_axes(const LatticeAxes& axes, const Body& body) {
  const auto call = [&](auto along, auto between) {
    body(along, between, std::integral_constant<int, 3 - along - between>{});
  };
  const auto with_along = [&](auto along) {
    constexpr int one = (along + 1) % 3, two = (along + 2) % 3;
    if (axes.between == one)
      call(along, std::integral_constant<int, one>{});
    else
      call(along, std::integral_constant<int, two>{});
  };
  if (axes.along == 0) return with_along(std::integral_constant<int, 0>{});
  if (axes.along == 1) return with_along(std::integral_constant<int, 1>{});
  with_along(std::integral_constant<int, 2>{});
}

/// The same for slots of a run. Its edges come in opposite pairs and along the lattice, so that neighbors are
/// added up with nothing but signs.
template <int kAlong, int kBetween, int kAcross>
void sum_edges_in_run(const FrameNodes& nodes, const LatticeRun& run, int first, int end, EdgeSum* sums) {
  const auto [s0, s1, s2, s3] = run.singles;
  const auto [p0, p1, p2, p3] = run.pairs;
  const float half_spacing = nodes.axes.half_spacing;
  const NodePlace* const places = nodes.places.data();
  const auto at = [&](int slot) { return loaded<Vector4>(places[slot].now.data()); };
  struct Four {
    Vector4 along, between, across;
  };
  const auto four = [&](int slot) -> Four {
    const Vector4 a = at(slot + p0), b = at(slot + p1), c = at(slot + p2), d = at(slot + p3);
    const Vector4 one = d - a, other = c - b;
    return {(a + d) + (b + c), one - other, one + other};
  };
  Four shared = four(first);
  for (int slot = first; slot < end; ++slot) {
    const Four next = four(slot + 1);
    const Vector4 along = at(slot + 1) - at(slot - 1), between = at(slot + s2) - at(slot + s1),
                  across = at(slot + s3) - at(slot + s0);
    EdgeSum& sum = sums[slot - first];
    sum.columns[kAlong] = half_spacing * ((along + along) + (next.along - shared.along));
    sum.columns[kBetween] = half_spacing * ((between + between) + (next.between + shared.between));
    sum.columns[kAcross] = half_spacing * ((across + across) + (next.across + shared.across));
    shared = next;
  }
}

template <bool kUniform>
void sum_edges_of(const FrameNodes& nodes, int first, int end, int& next, EdgeSum* sums) {
  ascend_parts(
      nodes.runs, first, end, next,
      [&](int begin, int stop, int) {
        for (int slot = begin; slot < stop; ++slot) sums[slot - first] = sum_row_edges<kUniform>(nodes, slot);
      },
      [&](const LatticeRun& run, int begin, int stop) {
        with_axes(nodes.axes, [&](auto along, auto between, auto across) {
          sum_edges_in_run<along, between, across>(nodes, run, begin, stop, sums + (begin - first));
        });
      });
}

/// The axis of an edge that is `length` long and has only one coordinate, a positive one; or -1.
int axis_of(const Eigen::Vector3d& edge, double length) {
  for (int axis = 0; axis < 3; ++axis)
    if ((edge - length * Eigen::Vector3d::Unit(axis)).cwiseAbs().maxCoeff() < kStraight * length) return axis;
  return -1;
}

/// Whether the edges of a lattice's row are those of body-centred cubes along `axes`.
bool has_lattice_edges(const std::array<Eigen::Vector3d, kLatticeNeighbors>& edges,
                       const Eigen::Vector3i& axes, double half) {
  /// By neighbor: half spacings along, between and across.
  constexpr std::array<std::array<int, 3>, kLatticeNeighbors> wanted = {{{0, 0, -2},
                                                                         {-1, -1, -1},
                                                                         {1, -1, -1},
                                                                         {-1, 1, -1},
                                                                         {1, 1, -1},
                                                                         {0, -2, 0},
                                                                         {-2, 0, 0},
                                                                         {2, 0, 0},
                                                                         {0, 2, 0},
                                                                         {-1, -1, 1},
                                                                         {1, -1, 1},
                                                                         {-1, 1, 1},
                                                                         {1, 1, 1},
                                                                         {0, 0, 2}}};
  for (int k = 0; k < kLatticeNeighbors; ++k)
    for (int a = 0; a < 3; ++a)
      if (!(std::abs(edges[k][axes[a]] - wanted[k][a] * half) < kStraight * half)) return false;
  return true;
}

}  // namespace

/// Per free slot its neighbors, ascending, and their weights unless all are one.
struct FrameNodes::Neighborhoods {
  LargeVector<int> offsets;
  LargeVector<int> neighbors;
  LargeVector<float> weights;
};

FrameNodes::FrameNodes(const Rig& rig) {
  number_slots(rig);
  place_at_rest(rig);
  const Neighborhoods lists = neighborhoods(rig);
  if (lists.weights.empty()) find_runs(rig, lists);
  group_links(lists);
}

void FrameNodes::number_slots(const Rig& rig) {
  free_count = static_cast<int>(rig.node_of_free.size());
  slot_count = rig.volume.node_count();
  node_of_slot.assign(rig.node_of_free.begin(), rig.node_of_free.end());
  for (int node = 0; node < slot_count; ++node) {
    if (rig.free_of_node[node] < 0) node_of_slot.push_back(node);
  }
  slot_of_node.resize(slot_count);
  for (int slot = 0; slot < slot_count; ++slot) slot_of_node[node_of_slot[slot]] = slot;
}

void FrameNodes::place_at_rest(const Rig& rig) {
  const Eigen::AlignedBox3d box = rest_box(rig.volume);
  diagonal = rest_diagonal(rig.volume);
  records.resize(slot_count);
  places.resize(slot_count);
  for (int slot = 0; slot < slot_count; ++slot) {
    const Eigen::Vector3d rest = rig.volume.rest_positions.row(node_of_slot[slot]).transpose();
    for (Eigen::Vector4f& column : records[slot].column) column.setZero();
    records[slot].rest = with_zero((rest - box.center()) / diagonal);
    places[slot] = {records[slot].rest, records[slot].rest};
  }
}

/// And the determinants of their edges.
FrameNodes::Neighborhoods FrameNodes::neighborhoods(const Rig& rig) {
  Neighborhoods lists;
  const Graph& graph = rig.volume.graph;
  const bool uniform =
      std::all_of(graph.weights.begin(), graph.weights.end(), [](double w) { return w == 1.0; });
  std::vector<std::pair<int, double>> around;
  lists.offsets.push_back(0);
  for (int slot = 0; slot < free_count; ++slot) {
    const int node = node_of_slot[slot];
    around.clear();
    Eigen::Matrix3d spread = Eigen::Matrix3d::Zero();
    for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
      around.emplace_back(slot_of_node[graph.neighbors[k]], graph.weights[k]);
      const Eigen::Vector3d edge =
          (records[slot].rest - records[around.back().first].rest).head<3>().cast<double>();
      spread += graph.weights[k] * edge * edge.transpose();
    }
    std::sort(around.begin(), around.end());
    for (const auto& [neighbor, weight] : around) {
      lists.neighbors.push_back(neighbor);
      if (!uniform) lists.weights.push_back(static_cast<float>(weight));
    }
    lists.offsets.push_back(static_cast<int>(lists.neighbors.size()));
    const double determinant = spread.determinant();
    const double even = std::pow(spread.trace() / 3.0, 3);
    inverse_rest_determinants.push_back(determinant > kFlat * even ? static_cast<float>(1.0 / determinant)
                                                                   : 0.0f);
  }
  return lists;
}

void FrameNodes::find_runs(const Rig& rig, const Neighborhoods& lists) {
  const double half = rig.volume.spacing / 2.0;
  if (rig.volume.interior != Interior::lattice || !(half > 0.0)) return;
  Eigen::Vector3i found = Eigen::Vector3i::Constant(-1);
  const auto alike = [&](int, int slot) {
    std::array<Eigen::Vector3d, kLatticeNeighbors> edges;
    for (int k = 0; k < kLatticeNeighbors; ++k)
      edges[k] = (rig.volume.rest_positions.row(node_of_slot[lists.neighbors[lists.offsets[slot] + k]]) -
                  rig.volume.rest_positions.row(node_of_slot[slot]))
                     .transpose();
    const Eigen::Vector3i own(axis_of(edges[7], 2 * half), axis_of(edges[8], 2 * half),
                              axis_of(edges[13], 2 * half));
    if (own.minCoeff() < 0 || !has_lattice_edges(edges, own, half)) return false;
    if (found.minCoeff() < 0) found = own;
    return own == found;
  };
  runs = lattice_runs({lists.offsets.data(), lists.offsets.size()},
                      {lists.neighbors.data(), lists.neighbors.size()}, alike);
  if (!runs.empty()) axes = {found[0], found[1], found[2], static_cast<float>(half / diagonal)};
}

/// Whole groups, and no links of slots in runs: what is left follows each other as it is walked.
void FrameNodes::group_links(const Neighborhoods& lists) {
  const auto link_to = [&](int slot, float weight) {
    links.push_back(kLinkUnit * slot);
    if (!lists.weights.empty()) weights.push_back(weight);
  };
  const auto in_runs = static_cast<std::size_t>(row_count(runs)), loose = free_count - in_runs;
  offsets.resize(static_cast<std::size_t>(free_count) + 1);
  links.reserve(lists.neighbors.size() - in_runs * kLatticeNeighbors + loose * (kLinkGroup - 1) + kAhead);
  half_rest_differences.reserve(loose);
  ascend_parts(
      runs, 0, free_count,
      [&](int first, int last, int) {
        for (int slot = first; slot < last; ++slot) {
          Eigen::Vector4d sum = Eigen::Vector4d::Zero();
          offsets[slot] = static_cast<int>(links.size());
          for (int k = lists.offsets[slot]; k < lists.offsets[slot + 1]; ++k) {
            const int neighbor = lists.neighbors[k];
            const float weight = lists.weights.empty() ? 1.0f : lists.weights[k];
            link_to(neighbor, weight);
            sum += weight * (records[slot].rest.cast<double>() - records[neighbor].rest.cast<double>());
          }
          while (links.size() % kLinkGroup != 0) link_to(slot, 0.0f);
          half_rest_differences.push_back((0.5 * sum).cast<float>());
        }
      },
      [&](const LatticeRun&, int first, int last) {
        std::fill(offsets.begin() + first, offsets.begin() + last, static_cast<int>(links.size()));
      });
  offsets[free_count] = static_cast<int>(links.size());
  links.insert(links.end(), kAhead, 0);
}

void residual_rows(const FrameNodes& nodes, int first, int end, Eigen::Vector4f* residual) {
  for_each_residual(nodes, first, end,
                    [&](int slot, const Vector4& row) { store(row, residual[slot].data()); });
}

SystemSize measure_rows(const FrameNodes& nodes, int first, int end) {
  const auto now = [&](int slot) -> Eigen::Vector4d { return nodes.places[slot].now.cast<double>(); };
  SystemSize size;
  for_each_residual(nodes, first, end, [&](int slot, const Vector4& row) {
    // The residual and what stands on the left side.
    Eigen::Vector4d b = as_eigen(row).cast<double>();
    size.residual += b.squaredNorm();
    nodes.for_each_neighbor(slot, [&](int neighbor, float weight) {
      b +=
          static_cast<double>(weight) * (neighbor < nodes.free_count ? now(slot) - now(neighbor) : now(slot));
    });
    size.right_hand_side += b.squaredNorm();
  });
  return size;
}

void sum_edges(const FrameNodes& nodes, int first, int count, int& next, FitBatch& batch) {
  EdgeSum sums[kFitLanes] = {};
  nodes.weights.empty() ? sum_edges_of<true>(nodes, first, first + count, next, sums)
                        : sum_edges_of<false>(nodes, first, first + count, next, sums);
  for (int lane = 0; lane < count; lane += 4)
    for (int column = 0; column < 3; ++column) {
      Vector4 rows[4];
      for (int k = 0; k < 4; ++k) rows[k] = sums[lane + k].columns[column];
      transpose(rows[0], rows[1], rows[2], rows[3]);
      for (int row = 0; row < 3; ++row) store(rows[row], &batch.sum[3 * row + column][lane]);
    }
}

}  // namespace sinew
