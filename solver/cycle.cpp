// Multigrid cycles [Trottenberg, Oosterlee, Schüller 2000]; Gauss-Seidel sweeps are [Shi et al. 2006, eq. 7].
#include "solver/cycle.h"

#include <algorithm>

#include "solver/row_passes.h"
#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

constexpr int kCorners = 8;
constexpr int kPiecesPerBlock = 512;
constexpr int kRowsPerBlock = 2048;

/// Entries of a transfer, two pieces or so, by which its passes tell the caches which fine nodes they will
/// want: a piece takes a few nodes of each of many lines.
constexpr int kAhead = 64;

// The node of an entry so far ahead, or of the last one.
inline int node_ahead(const PieceTransfer& P, int entry) {
  return P.nodes[std::min(entry + kAhead, static_cast<int>(P.nodes.size()) - 1)];
}

// The eight corner sums of one piece of `fine`, from the sums of its rows times products of coordinates: half
// the work of weighting every row for every corner. Eight variables rather than an array: they stay in
// registers.
template <int kWidth>
inline void restrict_piece(const PieceTransfer& P, int piece, const typename Lanes<kWidth>::Float* fine,
                           typename Lanes<kWidth>::Float* sums) {
  using Float = typename Lanes<kWidth>::Float;
  Float all{}, x{}, y{}, z{}, xy{}, xz{}, yz{}, xyz{};
  for (int entry = P.piece_offsets[piece]; entry < P.piece_offsets[piece + 1]; ++entry) {
    __builtin_prefetch(&fine[node_ahead(P, entry)]);
    const float* place = &P.places[3 * static_cast<std::size_t>(entry)];
    const Float row = fine[P.nodes[entry]];
    const Float row_x = row * place[0], row_y = row * place[1], row_xy = row_x * place[1];
    all += row;
    x += row_x;
    y += row_y;
    z += row * place[2];
    xy += row_xy;
    xz += row_x * place[2];
    yz += row_y * place[2];
    xyz += row_xy * place[2];
  }
  const Float s5 = xz - xyz, s6 = yz - xyz, s4 = (z - xz) - s6;
  sums[0] = ((all - x) - (y - xy)) - s4;
  sums[1] = (x - xy) - s5;
  sums[2] = (y - xy) - s6;
  sums[3] = xy - xyz;
  sums[4] = s4;
  sums[5] = s5;
  sums[6] = s6;
  sums[7] = xyz;
}

// Calls put(row of `fine`, value) with the trilinear value at every node of one piece: a polynomial of its
// place.
template <int kWidth, typename Put>
inline void interpolate_piece(const PieceTransfer& P, int piece, typename Lanes<kWidth>::Float* fine,
                              const typename Lanes<kWidth>::Float* coarse, const Put& put) {
  using Float = typename Lanes<kWidth>::Float;
  Float corner[kCorners];
  for (int k = 0; k < kCorners; ++k)
    corner[k] = coarse[P.corners[static_cast<std::size_t>(kCorners) * piece + k]];
  const Float none = corner[0], x = corner[1] - none, y = corner[2] - none, z = corner[4] - none;
  const Float x_behind = corner[5] - corner[4];
  const Float xy = (corner[3] - corner[2]) - x, xz = x_behind - x, yz = (corner[6] - corner[4]) - y;
  const Float xyz = ((corner[7] - corner[6]) - x_behind) - xy;
  for (int entry = P.piece_offsets[piece]; entry < P.piece_offsets[piece + 1]; ++entry) {
    __builtin_prefetch(&fine[node_ahead(P, entry)], 1);
    const float* place = &P.places[3 * static_cast<std::size_t>(entry)];
    const Float front = (none + place[0] * x) + place[1] * (y + place[0] * xy);
    const Float depth = (z + place[0] * xz) + place[1] * (yz + place[0] * xyz);
    put(fine[P.nodes[entry]], front + place[2] * depth);
  }
}

template <int kWidth>
void gather_corner_sums(const PieceTransfer& P, const typename Lanes<kWidth>::Float* sums,
                        typename Lanes<kWidth>::Float* coarse, int begin, int end) {
  for (int c = begin; c < end; ++c) {
    typename Lanes<kWidth>::Float total{};
    for (int use = P.use_offsets[c]; use < P.use_offsets[c + 1]; ++use) total += sums[P.uses[use]];
    coarse[c] = total;
  }
}

template <int kWidth>
void gather_transposed(const RowTransfer& P, const typename Lanes<kWidth>::Float* fine,
                       typename Lanes<kWidth>::Float* coarse, int begin, int end) {
  for (int c = begin; c < end; ++c) {
    typename Lanes<kWidth>::Float total{};
    for (int k = P.transposed_offsets[c]; k < P.transposed_offsets[c + 1]; ++k)
      total += P.transposed_values[k] * fine[P.fine_nodes[k]];
    coarse[c] = total;
  }
}

// The interpolated coarse value of fine node i; the node's own residual adds its share.
template <int kWidth>
inline typename Lanes<kWidth>::Float interpolated(const RowTransfer& P,
                                                  const typename Lanes<kWidth>::Float* coarse,
                                                  const typename Lanes<kWidth>::Float* residual, int i) {
  typename Lanes<kWidth>::Float sum = P.own_share[i] * residual[i];
  for (int k = P.offsets[i]; k < P.offsets[i + 1]; ++k) sum += P.values[k] * coarse[P.coarse_nodes[k]];
  return sum;
}

}  // namespace

bool finished_by_smoothing(const Hierarchy::Members& hierarchy, int level) {
  return level == 0 && hierarchy.transfers[level].pieces && hierarchy.transfers[level].pieces->linear;
}

int sweeps_on_level(const Hierarchy::Members& hierarchy, int level, int sweeps) {
  return level > 0 && hierarchy.transfers[level - 1].pieces ? (sweeps + 1) / 2 : sweeps;
}

CycleMemory::CycleMemory(const Hierarchy::Members& hierarchy, int width) {
  const std::size_t row_bytes = static_cast<std::size_t>(width) * sizeof(float);
  for (std::size_t level = 0; level < hierarchy.matrices.size(); ++level) {
    const auto rows = static_cast<std::size_t>(hierarchy.matrices[level].size());
    std::size_t sums = 0;
    if (level < hierarchy.transfers.size() && hierarchy.transfers[level].pieces)
      sums = hierarchy.transfers[level].pieces->corners.size();
    levels.push_back({AlignedMemory((rows + 1) * row_bytes), AlignedMemory(rows * row_bytes),
                      AlignedMemory(rows * row_bytes), AlignedMemory(sums * row_bytes)});
  }
  patch_rows = AlignedMemory(2 * static_cast<std::size_t>(row_count(hierarchy.patches)) * row_bytes);
}

template <int kWidth>
Cycle<kWidth>::Cycle(const Hierarchy::Members& hierarchy, int sweeps, ThreadTeam& team, CycleMemory& memory)
    : hierarchy_(hierarchy), sweeps_(sweeps), team_(team), memory_(memory) {
  // A cycle of another width may have left numbers where this one has its spare rows.
  for (int level = 0; level <= last_level(); ++level) x(level)[hierarchy.matrices[level].size()] = Float{};
}

template <int kWidth>
void Cycle<kWidth>::v_cycle() {
  if (last_level() > 0) clear(0);
  further_v_cycle();
}

template <int kWidth>
void Cycle<kWidth>::further_v_cycle() {
  if (last_level() == 0) return solve_last_level();
  improve(0);
}

template <int kWidth>
void Cycle<kWidth>::full_cycle() {
  descend();
  finish();
}

template <int kWidth>
void Cycle<kWidth>::descend() {
  for (int level = 0; level < last_level(); ++level) restrict_from(level, b(level));
  solve_last_level();
  for (int level = last_level() - 1; level >= 0; --level) {
    interpolate(level);
    if (level > 0) improve(level);
  }
}

template <int kWidth>
void Cycle<kWidth>::finish() {
  if (last_level() == 0) return;
  if (!finishes_by_smoothing()) return improve(0);
  begin_finish();
  finish_by_smoothing();
}

template <int kWidth>
void Cycle<kWidth>::begin_finish() {
  smooth_forward(0, kFinishingSweeps);
  solve_patches(0);
}

template <int kWidth>
void Cycle<kWidth>::finish_by_smoothing() {
  smooth_backward(0, kFinishingSweeps);
}

template <int kWidth>
void Cycle<kWidth>::improve(int level) {
  smooth_forward(level, sweeps_on_level(hierarchy_, level, sweeps_));
  solve_patches(level);
  improve_smoothed(level);
}

template <int kWidth>
void Cycle<kWidth>::improve_smoothed(int level) {
  restrict_residual(level);
  if (level + 1 == last_level())
    solve_last_level();
  else
    improve(level + 1);
  correct(level);
  smooth_backward(level, sweeps_on_level(hierarchy_, level, sweeps_));
}

template <int kWidth>
void Cycle<kWidth>::solve_last_level() {
  const int level = last_level();
  if (hierarchy_.bottom) return hierarchy_.bottom->template solve<kWidth>(b(level), x(level), scratch(level));
  clear(level);
  for (int sweep = 0; sweep < kLastLevelSweeps; ++sweep) {
    smooth_forward(level, 1);
    smooth_backward(level, 1);
  }
}

template <int kWidth>
void Cycle<kWidth>::clear(int level) {
  Float* const values = x(level);
  for_runs(team_, hierarchy_.matrices[level].size(), kRowsPerBlock,
           [&](int begin, int end) { std::fill(values + begin, values + end, Float{}); });
}

template <int kWidth>
template <typename Sweep>
void Cycle<kWidth>::sweep_parity(int level, int parity, const Sweep& sweep) {
  const LevelMatrix& A = hierarchy_.matrices[level];
  const int blocks = static_cast<int>(A.sweep_blocks.size()) - 1;
  team_.for_each_block((blocks + 1 - parity) / 2, [&](int half) {
    const int block = 2 * half + parity;
    sweep(A, b(level), x(level), A.sweep_blocks[block], A.sweep_blocks[block + 1]);
  });
}

template <int kWidth>
void Cycle<kWidth>::smooth_forward(int level, int count) {
  const auto sweep = row_passes<kWidth>(hierarchy_.matrices[level]).forward;
  for (int k = 0; k < count; ++k) {
    sweep_parity(level, 0, sweep);
    sweep_parity(level, 1, sweep);
  }
}

template <int kWidth>
void Cycle<kWidth>::smooth_backward(int level, int count) {
  const auto sweep = row_passes<kWidth>(hierarchy_.matrices[level]).backward;
  for (int k = 0; k < count; ++k) {
    sweep_parity(level, 1, sweep);
    sweep_parity(level, 0, sweep);
  }
}

// The patches' own equations, exactly, with the nodes around them held.
template <int kWidth>
void Cycle<kWidth>::solve_patches(int level) {
  if (level > 0) return;
  const LevelMatrix& A = hierarchy_.matrices[level];
  const Float* const right_hand_side = b(level);
  Float* const values = x(level);
  Float* const rows = memory_.patch_rows.as<Float>();
  team_.for_each_block(static_cast<int>(hierarchy_.patches.size()), [&](int index) {
    const Patch& patch = hierarchy_.patches[index];
    Float* const residual = rows + 2 * static_cast<std::size_t>(patch.first_row);
    for (int row = 0; row < patch.size(); ++row) {
      const int node = patch.nodes[row];
      Float sum{};
      for (int k = patch.offsets[row]; k < patch.offsets[row + 1]; ++k) {
        const float weight = patch.weights.empty() ? A.uniform_weight : patch.weights[k];
        sum += weight * values[patch.neighbors[k]];
      }
      residual[row] = right_hand_side[node] - A.diagonal[node] * values[node] + sum;
    }
    patch.factor.template solve<kWidth>(residual, residual, residual + patch.size());
    for (int row = 0; row < patch.size(); ++row) values[patch.nodes[row]] += residual[row];
  });
}

template <int kWidth>
void Cycle<kWidth>::restrict_from(int level, const Float* fine) {
  const Transfer& transfer = hierarchy_.transfers[level];
  Float* const coarse = b(level + 1);
  if (transfer.rows) {
    const RowTransfer& P = *transfer.rows;
    return for_runs(team_, P.coarse_count, kRowsPerBlock,
                    [&](int begin, int end) { gather_transposed<kWidth>(P, fine, coarse, begin, end); });
  }
  const PieceTransfer& P = *transfer.pieces;
  Float* const sums = corner_sums(level);
  for_runs(team_, P.piece_count(), kPiecesPerBlock, [&](int begin, int end) {
    for (int piece = begin; piece < end; ++piece)
      restrict_piece<kWidth>(P, piece, fine, sums + static_cast<std::size_t>(kCorners) * piece);
  });
  for_runs(team_, P.coarse_count, kRowsPerBlock,
           [&](int begin, int end) { gather_corner_sums<kWidth>(P, sums, coarse, begin, end); });
}

// The residual is stored before it is restricted: a sweep over the rows in their order and a pass over
// the pieces cost a third of a pass over the pieces that gathers each row's neighbors.
template <int kWidth>
void Cycle<kWidth>::restrict_residual(int level) {
  const LevelMatrix& A = hierarchy_.matrices[level];
  const auto residual = row_passes<kWidth>(A).residual;
  for_runs(team_, A.size(), kRowsPerBlock,
           [&](int begin, int end) { residual(A, b(level), x(level), scratch(level), begin, end); });
  restrict_from(level, scratch(level));
  clear(level + 1);
}

template <int kWidth>
void Cycle<kWidth>::interpolate(int level) {
  const Transfer& transfer = hierarchy_.transfers[level];
  const Float* const coarse = x(level + 1);
  Float* const fine = x(level);
  if (transfer.rows) {
    const RowTransfer& P = *transfer.rows;
    return for_runs(team_, hierarchy_.matrices[level].size(), kRowsPerBlock, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) fine[i] = interpolated<kWidth>(P, coarse, b(level), i);
    });
  }
  const PieceTransfer& P = *transfer.pieces;
  for_runs(team_, P.piece_count(), kPiecesPerBlock, [&](int begin, int end) {
    for (int piece = begin; piece < end; ++piece)
      interpolate_piece<kWidth>(P, piece, fine, coarse, [](Float& row, const Float& value) { row = value; });
  });
}

template <int kWidth>
void Cycle<kWidth>::correct(int level) {
  const Transfer& transfer = hierarchy_.transfers[level];
  const Float* const coarse = x(level + 1);
  Float* const fine = x(level);
  if (transfer.rows) {
    const RowTransfer& P = *transfer.rows;
    return for_runs(team_, hierarchy_.matrices[level].size(), kRowsPerBlock, [&](int begin, int end) {
      for (int i = begin; i < end; ++i) fine[i] += interpolated<kWidth>(P, coarse, scratch(level), i);
    });
  }
  const PieceTransfer& P = *transfer.pieces;
  for_runs(team_, P.piece_count(), kPiecesPerBlock, [&](int begin, int end) {
    for (int piece = begin; piece < end; ++piece)
      interpolate_piece<kWidth>(P, piece, fine, coarse, [](Float& row, const Float& value) { row += value; });
  });
}

template class Cycle<4>;
template class Cycle<8>;
template class Cycle<16>;

}  // namespace sinew
