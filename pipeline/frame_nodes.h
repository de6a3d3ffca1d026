#pragma once

#include <cstddef>
#include <vector>

#include "pipeline/local_step.h"
#include "pipeline/rig.h"
#include "solver/large_pages.h"
#include "solver/lattice_runs.h"

/// Internal to pipeline/: the graph as a frame walks it, and the two passes over its edges.
namespace sinew {

/// What an edge needs of a node for the residual: one cache line.
struct alignas(64) NodeRecord {
  /// Columns of M, scale times rotation; the fourth number of column k is coordinate k of 1/2 M x0 - x, from
  /// the rest position and the position now.
  Eigen::Vector4f column[3];
  Eigen::Vector4f rest;  ///< rest position, then 0
};

/// What an edge needs of a node for the local step.
struct alignas(32) NodePlace {
  Eigen::Vector4f rest;  ///< rest position, then 0
  Eigen::Vector4f now;   ///< position now, then 0
};

/// The links of a slot are handled so many at a time: what four neighbors add up to takes half of the
/// additions of four differences.
constexpr int kLinkGroup = 4;

/// A link is a slot times this, the most that an address takes a number times.
constexpr int kLinkUnit = 8;

/// The axes of a body-centred lattice, in the order in which free slots follow each other: along a line, from
/// line to line, from layer to layer. Coordinates grow with the slots.
struct LatticeAxes {
  int along = 0;
  int between = 1;
  int across = 2;
  float half_spacing = 0.0f;  ///< share of the diagonal
};

/// Nodes renumbered into slots: the free ones in the solver's order, then the constrained ones.
///
/// Positions are shares of the rest box's diagonal: at rest from the box's middle, now from the pose's first
/// joint. Edges are handled in single precision as differences of what their ends keep, those of a residual
/// four and more at a time: a rigid body of 100,000 nodes is left 4e-8 at rest and, as M x0 is rounded, 2e-7
/// when turned (root mean squares over the rows, each the sum of some fourteen edges).
struct FrameNodes {
  explicit FrameNodes(const Rig& rig);

  void set_position(int slot, const Eigen::Vector4f& now) {
    NodeRecord& record = records[slot];
    Eigen::Vector4f half_turned = Eigen::Vector4f::Zero();
    for (int axis = 0; axis < 3; ++axis) half_turned += 0.5f * record.rest[axis] * record.column[axis];
    for (int axis = 0; axis < 3; ++axis) record.column[axis][3] = half_turned[axis] - now[axis];
  }

  /// Calls body(neighbor, weight) for the neighbors of a free slot.
  template <typename Body>
  void for_each_neighbor(int slot, const Body& body) const {
    for (int k = offsets[slot]; k < offsets[slot + 1] && links[k] != kLinkUnit * slot; ++k)
      body(links[k] / kLinkUnit, weights.empty() ? 1.0f : weights[k]);
    const auto run = static_cast<std::size_t>(first_run_behind(runs, slot));
    if (run == runs.size() || slot < runs[run].first) return;
    for (const int neighbor : runs[run].neighbors(slot)) body(neighbor, 1.0f);
  }

  /// Of values by slot, the one that link k leads to.
  template <typename Value>
  const Value& linked(const Value* values, int k) const {
    static_assert(sizeof(Value) % kLinkUnit == 0);
    const char* const place = reinterpret_cast<const char*>(values);
    return *reinterpret_cast<const Value*>(place + std::ptrdiff_t{links[k]} * (sizeof(Value) / kLinkUnit));
  }

  double diagonal = 1.0;
  int free_count = 0;
  int slot_count = 0;
  LargeVector<int> node_of_slot;
  LargeVector<int> slot_of_node;
  LargeVector<int> offsets;  ///< per free slot, into links and weights: whole groups
  LargeVector<int> links;    ///< to slots, ascending: the held ones last, then to the slot
                             ///< itself until the group is full; none of a slot in a run;
                             ///< behind the last group some to spare
  LargeVector<float> weights;                    ///< empty where all are one
  LargeVector<float> inverse_rest_determinants;  ///< per free slot, of sum w e e^T; 0 where flat
  LargeVector<Eigen::Vector4f> half_rest_differences;  ///< per free slot outside runs: half of sum w e
  LargeVector<NodeRecord> records;
  LargeVector<NodePlace> places;

  /// Free slots whose edges are those of the lattice. Empty where the weights are not all one.
  std::vector<LatticeRun> runs;
  LatticeAxes axes;

 private:
  void number_slots(const Rig& rig);
  void place_at_rest(const Rig& rig);
  struct Neighborhoods;
  Neighborhoods neighborhoods(const Rig& rig);
  void find_runs(const Rig& rig, const Neighborhoods& lists);
  void group_links(const Neighborhoods& lists);
};

/// For free slots [first, end), with the rotations, scales and positions of the records:
///
///     residual_i = sum_j w(i,j) [1/2 (s_i R_i + s_j R_j) (x0_i - x0_j) - (x_i - x_j)]
///
/// [Shi et al. 2006, eq. 11] with everything on one side. With M = s R and (L f)_i = sum_j w(i,j) (f_i - f_j)
/// the edges are those of a product rule,
///
///     residual = L(1/2 M x0 - x) - 1/2 (L M) x0 + 1/2 M (L x0),
///
/// so that an edge costs the difference of two records and nothing else. Inside a lattice L x0 = 0.
void residual_rows(const FrameNodes& nodes, int first, int end, Eigen::Vector4f* residual);

/// Sums of squares over free slots.
struct SystemSize {
  double residual = 0.0;
  double right_hand_side = 0.0;
};

/// Of the residual and of the right-hand side it belongs to, held neighbors moved to that side.
SystemSize measure_rows(const FrameNodes& nodes, int first, int end);

/// Fills the lanes [0, count) of the batch with the sums over the edges of slots first, first + 1, ...: w e'
/// e^T, e' the edge by places now. Lanes behind them, up to a multiple of four, become zero. `next`:
/// first_run_behind(nodes.runs, first), and afterwards that of the slot behind the last.
void sum_edges(const FrameNodes& nodes, int first, int count, int& next, FitBatch& batch);

}  // namespace sinew
