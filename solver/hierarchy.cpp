#include "solver/hierarchy.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <iomanip>
#include <ostream>
#include <stdexcept>
#include <string>

#include "solver/galerkin.h"
#include "solver/hierarchy_levels.h"
#include "solver/lattice_coarsening.h"
#include "solver/patch_search.h"
#include "solver/shi_coarsening.h"
#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

/// Cells of the first lattice, in mean edge lengths. Smaller ones interpolate better and leave more to
/// do on the coarse levels; the time to a given residual is flat between 2.5 and 3.
constexpr double kFirstCell = 2.75;

/// A level that keeps more than this share of its nodes is not worth having.
constexpr double kLargestShare = 0.7;

/// Rows per block of parallel work.
constexpr int kRowsPerBlock = 4096;

/// A last level larger than this is swept instead of factored.
constexpr int kLargestFactor = 20000;

/// Whether all edges have one weight.
bool has_one_weight(const Graph& graph, ThreadTeam& team) {
  constexpr int fewest_weights = 1 << 16;
  std::atomic<bool> equal = true;
  for_runs(team, static_cast<int>(graph.weights.size()), fewest_weights, [&](int begin, int end) {
    const auto alike = [&](double weight) { return weight == graph.weights.front(); };
    if (!std::all_of(graph.weights.begin() + begin, graph.weights.begin() + end, alike)) equal = false;
  });
  return equal;
}

LevelMatrix level_matrix(const LinearSystem& system, ThreadTeam& team) {
  const Graph& graph = system.graph;
  LevelMatrix matrix;
  matrix.offsets.assign(graph.offsets.begin(), graph.offsets.end());
  matrix.neighbors.assign(graph.neighbors.begin(), graph.neighbors.end());
  // One weight in double: short rows, which have no others, serve residuals in double as well.
  if (has_one_weight(graph, team))
    matrix.uniform_weight = graph.weights.empty() ? 0.0f : static_cast<float>(graph.weights.front());
  else
    matrix.weights.assign(graph.weights.begin(), graph.weights.end());
  const int n = graph.node_count();
  matrix.diagonal.resize(static_cast<std::size_t>(n));
  for_items(team, n, kRowsPerBlock, [&](int i) {
    double diagonal = system.anchor[i];
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) diagonal += graph.weights[k];
    matrix.diagonal[i] = static_cast<float>(diagonal);
  });
  finish_level(matrix);
  return matrix;
}

bool fits_a_lattice(const Field3& positions, double cell, ThreadTeam& team) {
  if (!(std::isfinite(cell) && cell > 0)) return false;
  const Eigen::AlignedBox3d box = box_around(positions, team);
  return !box.isEmpty() && box.sizes().maxCoeff() < kMostCellsAlong * cell;
}

// The next level by the first means that shrinks this one enough: a lattice, coarser lattices, and
// aggregates, which need no positions. Its coarse_count is 0 when nothing helps.
PieceCoarsening coarsen(const LevelMatrix& matrix, const Field3& positions, double cell, ThreadTeam& team) {
  const double limit = kLargestShare * matrix.size();
  if (fits_a_lattice(positions, cell, team))
    for (int doubling = 0; doubling < 3; ++doubling, cell *= 2) {
      PieceCoarsening lattice = coarsen_by_lattice(matrix, positions, cell, team);
      if (lattice.transfer.coarse_count <= limit) return lattice;
    }
  PieceCoarsening aggregates = coarsen_by_aggregation(matrix, positions);
  if (aggregates.transfer.coarse_count > limit) aggregates.transfer.coarse_count = 0;
  return aggregates;
}

void add_lattice_levels(const LinearSystem& system, const HierarchyOptions& options, ThreadTeam& team,
                        Hierarchy::Members& members) {
  const Field3* positions = &system.rest_positions;
  Field3 coarse_positions;
  double cell = kFirstCell * mean_edge_length(members.matrices.back(), *positions, team);
  while (members.matrices.back().size() > options.coarsest_size &&
         static_cast<int>(members.matrices.size()) < options.max_levels) {
    PieceCoarsening next = coarsen(members.matrices.back(), *positions, cell, team);
    if (next.transfer.coarse_count == 0) return;
    members.matrices.push_back(galerkin_product(members.matrices.back(), next.transfer, team));
    members.transfers.push_back({std::move(next.transfer), std::nullopt});
    coarse_positions = std::move(next.positions);
    positions = &coarse_positions;
    cell = 2;  // positions are now in cells of this level's lattice
  }
}

void add_shi_levels(const LinearSystem& system, const HierarchyOptions& options, ThreadTeam& team,
                    Hierarchy::Members& members) {
  LinearSystem coarser;
  for (const LinearSystem* level = &system; level->graph.node_count() > options.coarsest_size &&
                                            static_cast<int>(members.matrices.size()) < options.max_levels;
       level = &coarser) {
    ShiCoarsening next = coarsen_by_independent_set(*level);
    if (next.coarse.graph.node_count() > kLargestShare * level->graph.node_count()) return;
    coarser = std::move(next.coarse);
    members.matrices.push_back(level_matrix(coarser, team));
    members.transfers.push_back({std::nullopt, std::move(next.defect)});
    members.descents.push_back(std::move(next.descent));
  }
}

// Shi 2006's levels are read along their neighbors to the end, and the smallest systems are never swept.
void shorten_rows(LevelMatrix& finest, ThreadTeam& team) {
  if (!finest.weights.empty()) return;
  finest.short_rows = short_rows(finest.offsets, finest.neighbors, finest.diagonal, team);
}

void check_options(const LinearSystem& system, const HierarchyOptions& options) {
  if (options.coarsest_size < 1)
    throw std::invalid_argument("Hierarchy: coarsest_size is " + std::to_string(options.coarsest_size) +
                                "; expected at least 1");
  if (options.max_levels < 1)
    throw std::invalid_argument("Hierarchy: max_levels is " + std::to_string(options.max_levels) +
                                "; expected at least 1");
  if (system.anchor.size() != system.graph.node_count())
    throw std::invalid_argument("Hierarchy: anchor has " + std::to_string(system.anchor.size()) +
                                " entries; expected " + std::to_string(system.graph.node_count()));
  if (system.rest_positions.rows() != system.graph.node_count())
    throw std::invalid_argument("Hierarchy: rest_positions has " +
                                std::to_string(system.rest_positions.rows()) + " rows; expected " +
                                std::to_string(system.graph.node_count()));
}

}  // namespace

std::size_t LevelMatrix::bytes() const {
  return bytes_of(offsets) + bytes_of(neighbors) + bytes_of(weights) + bytes_of(diagonal) +
         bytes_of(inverse_diagonal) + bytes_of(sweep_blocks) + short_rows.bytes();
}

std::size_t PieceTransfer::bytes() const {
  return bytes_of(piece_offsets) + bytes_of(nodes) + bytes_of(places) + bytes_of(corners) +
         bytes_of(use_offsets) + bytes_of(uses);
}

std::size_t RowTransfer::bytes() const {
  return bytes_of(offsets) + bytes_of(coarse_nodes) + bytes_of(values) + bytes_of(transposed_offsets) +
         bytes_of(fine_nodes) + bytes_of(transposed_values) + bytes_of(own_share);
}

std::size_t EdgeDescent::bytes() const {
  return bytes_of(coarse_of_fine) + bytes_of(fine_of_coarse) + bytes_of(anchor) + bytes_of(inverse_reach) +
         bytes_of(path_offsets) + bytes_of(first_entries) + bytes_of(second_entries) + bytes_of(shares);
}

Hierarchy::Hierarchy(const LinearSystem& system, const HierarchyOptions& options, ThreadTeam& team)
    : members_(std::make_unique<Members>()) {
  check_options(system, options);
  members_->matrices.push_back(level_matrix(system, team));
  if (options.coarsening == Coarsening::shi2006)
    add_shi_levels(system, options, team, *members_);
  else
    add_lattice_levels(system, options, team, *members_);
  LevelMatrix& finest = members_->matrices.front();
  const LevelMatrix& last = members_->matrices.back();
  const bool factored = last.size() <= std::max(kLargestFactor, options.coarsest_size);
  const bool patched = options.coarsening == Coarsening::lattice && members_->matrices.size() > 1;
  // Neither is shared well among threads, so each takes one.
  team.for_each_block(2, [&](int task) {
    ThreadTeam alone;
    if (task == 0 && factored) members_->bottom.emplace(to_sparse(last));
    if (task == 1 && patched) shorten_rows(finest, alone);
  });
  if (!patched) return;
  PatchSearch search = find_patches(*members_, team);
  members_->patches = std::move(search.patches);
  members_->kept = std::move(search.kept);
  if (!finest.short_rows.empty()) LargeVector<int>().swap(finest.neighbors);
}

Hierarchy::~Hierarchy() = default;
Hierarchy::Hierarchy(Hierarchy&&) noexcept = default;
Hierarchy& Hierarchy::operator=(Hierarchy&&) noexcept = default;

std::vector<LevelSummary> Hierarchy::levels() const {
  std::vector<LevelSummary> result;
  for (std::size_t level = 0; level < members_->matrices.size(); ++level) {
    const LevelMatrix& matrix = members_->matrices[level];
    LevelSummary summary{matrix.size(), matrix.entries(), matrix.bytes()};
    if (level == 0) {
      summary.bytes += bytes_of(members_->kept);
      for (const Patch& patch : members_->patches) summary.bytes += patch.bytes();
    }
    if (level < members_->transfers.size()) summary.bytes += members_->transfers[level].bytes();
    if (level < members_->descents.size()) summary.bytes += members_->descents[level].bytes();
    result.push_back(summary);
  }
  if (members_->bottom) result.back().bytes += members_->bottom->bytes();
  return result;
}

std::size_t Hierarchy::bytes() const {
  std::size_t total = 0;
  for (const LevelSummary& level : levels()) total += level.bytes;
  return total;
}

std::ostream& operator<<(std::ostream& out, const Hierarchy& hierarchy) {
  const std::vector<LevelSummary> levels = hierarchy.levels();
  out << "level      nodes      entries        bytes\n";
  std::int64_t entries = 0;
  for (std::size_t level = 0; level < levels.size(); ++level) {
    entries += levels[level].entries + levels[level].nodes;
    out << std::setw(5) << level << std::setw(11) << levels[level].nodes << std::setw(13)
        << levels[level].entries << std::setw(13) << levels[level].bytes << '\n';
  }
  const auto finest = static_cast<double>(levels.front().entries + levels.front().nodes);
  const auto complexity = finest > 0 ? static_cast<double>(entries) / finest : 1.0;
  const int patch_nodes = row_count(hierarchy.members().patches);
  if (patch_nodes > 0) out << "nodes in patches " << patch_nodes << ", ";
  out << "operator complexity " << std::round(complexity * 100) / 100 << ", last level "
      << (hierarchy.members().bottom ? "factored" : "swept: too large to factor") << '\n';
  return out;
}

}  // namespace sinew
