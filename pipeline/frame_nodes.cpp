#include "pipeline/frame_nodes.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "solver/wide.h"

namespace sinew {
namespace {

/// A neighborhood flatter than this share of an even one has no volume to speak of.
constexpr double kFlat = 1e-3;

/// Links, three rows or so, by which the passes over the edges tell the caches what they will want: the
/// records of a large body do not fit the second level. As many entries behind the last link make that safe.
constexpr int kAhead = 48;

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

/// sum_j w 1/2 (s_i R_i + s_j R_j) (x0_i - x0_j), and sum_j w (x_i - x_j).
struct RowSums {
  Vector4 wanted;
  Vector4 found;
};

/// All differences of an edge are one subtraction: the record of one end minus that of the other.
template <bool kUniform>
inline RowSums row_sums(const FrameNodes& nodes, int slot) {
  const auto own = loaded<Vector16>(nodes.records[slot].column[0].data());
  Vector16 differences{};
  Vector16 turned{};
  const int end = nodes.offsets[slot + 1];
  for (int k = nodes.offsets[slot]; k < end; ++k) {
    __builtin_prefetch(&nodes.records[nodes.neighbors[k + kAhead]]);
    const Vector16& other = as_vector(nodes.records[nodes.neighbors[k]]);
    Vector16 difference = own - other;
    if constexpr (!kUniform) difference *= nodes.weights[k];
    differences += difference;
    turned += spread_rest(difference) * other;
  }
  turned += spread_rest(differences) * own;
  return {0.5f * sum_of_columns(turned), positions_of(differences)};
}

template <bool kUniform>
void residuals(const FrameNodes& nodes, int first, int end, Eigen::Vector4f* residual) {
  for (int slot = first; slot < end; ++slot) {
    const RowSums sums = row_sums<kUniform>(nodes, slot);
    store(sums.wanted - sums.found, residual[slot].data());
  }
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

template <bool kUniform>
void sum_batch_edges(const FrameNodes& nodes, int first, int count, FitBatch& batch) {
  for (int lane = 0; lane < count; lane += 4) {
    EdgeSum sums[4] = {};
    for (int k = 0; k < std::min(4, count - lane); ++k)
      sums[k] = sum_row_edges<kUniform>(nodes, first + lane + k);
    for (int column = 0; column < 3; ++column) {
      Vector4 rows[4];
      for (int k = 0; k < 4; ++k) rows[k] = sums[k].columns[column];
      transpose(rows[0], rows[1], rows[2], rows[3]);
      for (int row = 0; row < 3; ++row) store(rows[row], &batch.sum[3 * row + column][lane]);
    }
  }
}

}  // namespace

FrameNodes::FrameNodes(const Rig& rig) {
  number_slots(rig);
  place_at_rest(rig);
  copy_neighborhoods(rig);
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

void residual_rows(const FrameNodes& nodes, int first, int end, Eigen::Vector4f* residual) {
  nodes.weights.empty() ? residuals<true>(nodes, first, end, residual)
                        : residuals<false>(nodes, first, end, residual);
}

SystemSize measure_rows(const FrameNodes& nodes, int first, int end) {
  SystemSize size;
  for (int slot = first; slot < end; ++slot) {
    const RowSums sums = nodes.weights.empty() ? row_sums<true>(nodes, slot) : row_sums<false>(nodes, slot);
    size.residual += as_eigen(sums.wanted - sums.found).cast<double>().squaredNorm();
    Eigen::Vector4d b = as_eigen(sums.wanted).cast<double>();
    for (int k = nodes.offsets[slot + 1] - 1; k >= nodes.offsets[slot]; --k) {
      const int neighbor = nodes.neighbors[k];
      if (neighbor < nodes.free_count) break;
      const double weight = nodes.weights.empty() ? 1.0 : static_cast<double>(nodes.weights[k]);
      b += weight * as_eigen(positions_of(as_vector(nodes.records[neighbor]))).cast<double>();
    }
    size.right_hand_side += b.squaredNorm();
  }
  return size;
}

void sum_edges(const FrameNodes& nodes, int first, int count, FitBatch& batch) {
  nodes.weights.empty() ? sum_batch_edges<true>(nodes, first, count, batch)
                        : sum_batch_edges<false>(nodes, first, count, batch);
}

}  // namespace sinew
