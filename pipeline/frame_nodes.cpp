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

using Vector4 = Wide<float, 4>;
using Vector8 = Wide<float, 8>;
using Vector16 = Wide<float, 16>;

Eigen::Vector4f with_zero(const Eigen::Vector3d& vector) {
  Eigen::Vector4f four = Eigen::Vector4f::Zero();
  four.head<3>() = vector.cast<float>();
  return four;
}

inline const Vector16& as_vector(const NodeRecord& record) {
  return reinterpret_cast<const Vector16&>(record);
}
inline const Vector8& as_vector(const NodePlace& place) {
  return reinterpret_cast<const Vector8&>(place);
}

/// Four numbers of a register from `first` on, each in all of one quarter.
template <int first, typename Register>
inline Vector16 each_in_a_quarter(const Register& v) {
  constexpr int a = first, b = first + 1, c = first + 2, d = first + 3;
  if constexpr (kRegisterFloats >= 16)
    return __builtin_shufflevector(v, v, a, a, a, a, b, b, b, b, c, c, c, c, d, d, d, d);
  else if constexpr (kRegisterFloats >= 8)
    return {__builtin_shufflevector(v, v, a, a, a, a, b, b, b, b),
            __builtin_shufflevector(v, v, c, c, c, c, d, d, d, d)};
  else
    return {{__builtin_shufflevector(v, v, a, a, a, a), __builtin_shufflevector(v, v, b, b, b, b)},
            {__builtin_shufflevector(v, v, c, c, c, c), __builtin_shufflevector(v, v, d, d, d, d)}};
}

/// Rest coordinate k in all of column k; the last four are the rest's own zero.
template <typename Vector>
inline Vector16 spread_rest(const Vector& v) {
  if constexpr (kIsHalved<Vector>)
    return spread_rest(v.high);
  else
    return each_in_a_quarter<kRegisterFloats - 4>(v);
}

/// The rest coordinates of an edge, likewise, and where it points now in every column.
template <typename Vector>
inline Vector16 spread_rest_of_place(const Vector& edge) {
  if constexpr (kIsHalved<Vector>)
    return each_in_a_quarter<0>(edge.low);
  else
    return each_in_a_quarter<0>(edge);
}
template <typename Vector>
inline Vector16 repeat_now_of_place(const Vector& edge) {
  if constexpr (kRegisterFloats >= 16) {
    return __builtin_shufflevector(edge, edge, 4, 5, 6, 7, 4, 5, 6, 7, 4, 5, 6, 7, 4, 5, 6, 7);
  } else if constexpr (kRegisterFloats >= 8) {
    const auto twice = __builtin_shufflevector(edge, edge, 4, 5, 6, 7, 4, 5, 6, 7);
    return {twice, twice};
  } else {
    return {{edge.high, edge.high}, {edge.high, edge.high}};
  }
}

/// All in registers: what is written number by number and read back as a vector costs as much as half a row.
inline Vector4 zero_behind_three(const Vector4& v) {
  return __builtin_shufflevector(v, Vector4{}, 0, 1, 2, 4);
}
inline Vector4 sum_of_columns(const Vector16& v) {
  return zero_behind_three(quarter<0>(v) + quarter<1>(v) + quarter<2>(v));
}

/// The fourth numbers of the columns.
inline Vector4 positions_of(const Vector16& v) {
  const Vector4 two = __builtin_shufflevector(quarter<0>(v), quarter<1>(v), 3, 7, 3, 7);
  return zero_behind_three(__builtin_shufflevector(two, quarter<2>(v), 0, 1, 7, 7));
}

inline Eigen::Vector4f as_eigen(const Vector4& v) {
  Eigen::Vector4f four;
  store(v, four.data());
  return four;
}

/// From L of the records, the residual but for what the rest's own L adds.
inline Vector4 residual_of(const Vector16& own, const Vector16& differences) {
  return positions_of(differences) - 0.5f * sum_of_columns(spread_rest(own) * differences);
}

template <bool kUniform>
inline Vector4 residual_row(const FrameNodes& nodes, int slot) {
  const auto own = loaded<Vector16>(nodes.records[slot].column[0].data());
  Vector16 differences{};
  const int end = nodes.offsets[slot + 1];
  for (int k = nodes.offsets[slot]; k < end; ++k) {
    __builtin_prefetch(&nodes.records[nodes.neighbors[k + kAhead]]);
    Vector16 difference = own - as_vector(nodes.records[nodes.neighbors[k]]);
    if constexpr (!kUniform) difference *= nodes.weights[k];
    differences += difference;
  }
  return residual_of(own, differences) + 0.5f * sum_of_columns(spread_rest(differences) * own);
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
    visit(slot, residual_of(own, differences));
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
      [&](int begin, int stop, int) {
        if (nodes.weights.empty()) {
          for (int slot = begin; slot < stop; ++slot) visit(slot, residual_row<true>(nodes, slot));
        } else {
          for (int slot = begin; slot < stop; ++slot) visit(slot, residual_row<false>(nodes, slot));
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
  const Vector8 own = as_vector(nodes.places[slot]);
  Vector16 sum{};
  const int end = nodes.offsets[slot + 1];
  for (int k = nodes.offsets[slot]; k < end; ++k) {
    __builtin_prefetch(&nodes.places[nodes.neighbors[k + kAhead]]);
    const Vector8 edge = own - as_vector(nodes.places[nodes.neighbors[k]]);
    Vector16 now = repeat_now_of_place(edge);
    if constexpr (!kUniform) now *= nodes.weights[k];
    sum += spread_rest_of_place(edge) * now;
  }
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

FrameNodes::FrameNodes(const Rig& rig) {
  number_slots(rig);
  place_at_rest(rig);
  copy_neighborhoods(rig);
  if (weights.empty()) find_runs(rig);
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

void FrameNodes::copy_neighborhoods(const Rig& rig) {
  const Graph& graph = rig.volume.graph;
  const bool uniform =
      std::all_of(graph.weights.begin(), graph.weights.end(), [](double w) { return w == 1.0; });
  std::vector<std::pair<int, double>> around;
  offsets.push_back(0);
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
      neighbors.push_back(neighbor);
      if (!uniform) weights.push_back(static_cast<float>(weight));
    }
    offsets.push_back(static_cast<int>(neighbors.size()));
    const double determinant = spread.determinant();
    const double even = std::pow(spread.trace() / 3.0, 3);
    inverse_rest_determinants.push_back(determinant > kFlat * even ? static_cast<float>(1.0 / determinant)
                                                                   : 0.0f);
  }
  neighbors.insert(neighbors.end(), kAhead, 0);
}

void FrameNodes::find_runs(const Rig& rig) {
  const double half = rig.volume.spacing / 2.0;
  if (rig.volume.interior != Interior::lattice || !(half > 0.0)) return;
  Eigen::Vector3i found = Eigen::Vector3i::Constant(-1);
  const auto alike = [&](int, int slot) {
    std::array<Eigen::Vector3d, kLatticeNeighbors> edges;
    for (int k = 0; k < kLatticeNeighbors; ++k)
      edges[k] = (rig.volume.rest_positions.row(node_of_slot[neighbors[offsets[slot] + k]]) -
                  rig.volume.rest_positions.row(node_of_slot[slot]))
                     .transpose();
    const Eigen::Vector3i own(axis_of(edges[7], 2 * half), axis_of(edges[8], 2 * half),
                              axis_of(edges[13], 2 * half));
    if (own.minCoeff() < 0 || !has_lattice_edges(edges, own, half)) return false;
    if (found.minCoeff() < 0) found = own;
    return own == found;
  };
  runs = lattice_runs({offsets.data(), offsets.size()},
                      {neighbors.data(), static_cast<std::size_t>(offsets.back())}, alike);
  if (runs.empty()) return;
  axes = {found[0], found[1], found[2], static_cast<float>(half / diagonal)};
  forget_lists_in_runs();
}

/// What is left follows each other as it is walked.
void FrameNodes::forget_lists_in_runs() {
  LargeVector<int> kept;
  kept.reserve(neighbors.size() - static_cast<std::size_t>(row_count(runs)) * kLatticeNeighbors);
  ascend_parts(
      runs, 0, free_count,
      [&](int first, int last, int) {
        for (int slot = first; slot < last; ++slot) {
          const int begin = offsets[slot], end = offsets[slot + 1];
          offsets[slot] = static_cast<int>(kept.size());
          kept.insert(kept.end(), neighbors.begin() + begin, neighbors.begin() + end);
        }
      },
      [&](const LatticeRun&, int first, int last) {
        std::fill(offsets.begin() + first, offsets.begin() + last, static_cast<int>(kept.size()));
      });
  offsets[free_count] = static_cast<int>(kept.size());
  kept.insert(kept.end(), kAhead, 0);
  neighbors = std::move(kept);
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
