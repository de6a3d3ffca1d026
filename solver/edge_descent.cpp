// [Shi, Yu, Bell, Feng 2006], section 5.3 and the appendix.
#include "solver/edge_descent.h"

#include "solver/sweep_blocks.h"

namespace sinew {
namespace {

constexpr int kRowsPerBlock = 2048;

using Float = Lanes<4>::Float;

Float single(const Field3& field, int row) {
  return Float{static_cast<float>(field(row, 0)), static_cast<float>(field(row, 1)),
               static_cast<float>(field(row, 2)), 0.0f};
}

// (20): a coarse edge wants the mean of what the paths along it want. `wanted(entry)` reads the fine level.
template <typename Wanted>
void descend_targets(const EdgeDescent& descent, int coarse_entries, const Wanted& wanted, ThreadTeam& team,
                     Float* coarse_wanted) {
  for_items(team, coarse_entries, kRowsPerBlock, [&](int entry) {
    Float sum{};
    for (int path = descent.path_offsets[entry]; path < descent.path_offsets[entry + 1]; ++path) {
      Float along = wanted(descent.first_entries[path]);
      if (descent.second_entries[path] >= 0) along += wanted(descent.second_entries[path]);
      sum += descent.shares[path] * along;
    }
    coarse_wanted[entry] = sum;
  });
}

// (22)
template <typename Wanted>
void descend_beta(const EdgeDescent& descent, const LevelMatrix& fine, const Wanted& wanted,
                  const Float* beta, ThreadTeam& team, Float* coarse_beta) {
  for_items(team, static_cast<int>(descent.fine_of_coarse.size()), kRowsPerBlock, [&](int coarse_node) {
    const int node = descent.fine_of_coarse[coarse_node];
    Float sum = beta[node];
    for (int k = fine.offsets[node]; k < fine.offsets[node + 1]; ++k) {
      const int i = fine.neighbors[k];
      if (descent.coarse_of_fine[i] >= 0) continue;
      sum += fine.weight(k) * descent.inverse_reach[i] * (beta[i] + descent.anchor[i] * wanted(k));
    }
    coarse_beta[coarse_node] = sum;
  });
}

template <typename Wanted>
void gather_right_hand_side(const LevelMatrix& matrix, const Wanted& wanted, const Float* beta,
                            ThreadTeam& team, Float* b) {
  for_items(team, matrix.size(), kRowsPerBlock, [&](int i) {
    Float sum = beta[i];
    for (int k = matrix.offsets[i]; k < matrix.offsets[i + 1]; ++k) sum += matrix.weight(k) * wanted(k);
    b[i] = sum;
  });
}

// (14)
template <typename Wanted>
void interpolate_along_edges(const EdgeDescent& descent, const LevelMatrix& fine, const Wanted& wanted,
                             const Float* beta, const Float* coarse_x, ThreadTeam& team, Float* x) {
  for_items(team, fine.size(), kRowsPerBlock, [&](int i) {
    if (descent.coarse_of_fine[i] >= 0) {
      x[i] = coarse_x[descent.coarse_of_fine[i]];
      return;
    }
    Float sum = beta[i];
    for (int k = fine.offsets[i]; k < fine.offsets[i + 1]; ++k)
      if (const int c = descent.coarse_of_fine[fine.neighbors[k]]; c >= 0)
        sum += fine.weight(k) * (coarse_x[c] + wanted(k));
    x[i] = sum * descent.inverse_reach[i];
  });
}

// Hands `body` the way to read what the edges of a level want.
template <typename Body>
void with_wanted(const EdgeTargets& targets, const EdgeMemory& memory, int level, const Body& body) {
  if (level == 0) {
    body([&targets](int entry) { return single(targets.wanted, entry); });
  } else {
    const Float* const wanted = memory.wanted[level].as<Float>();
    body([wanted](int entry) { return wanted[entry]; });
  }
}

}  // namespace

EdgeMemory::EdgeMemory(const Hierarchy::Members& hierarchy) {
  for (const LevelMatrix& matrix : hierarchy.matrices) {
    wanted.emplace_back(wanted.empty() ? 0 : matrix.neighbors.size() * sizeof(Float));
    beta.emplace_back(static_cast<std::size_t>(matrix.size()) * sizeof(Float));
  }
}

void full_cycle_along_edges(const Hierarchy::Members& hierarchy, const EdgeTargets& targets, ThreadTeam& team,
                            EdgeMemory& memory, Cycle<4>& cycle) {
  const int last = static_cast<int>(hierarchy.matrices.size()) - 1;
  const auto beta = [&](int level) { return memory.beta[level].as<Float>(); };
  for_items(team, hierarchy.matrices[0].size(), kRowsPerBlock,
            [&](int i) { beta(0)[i] = single(targets.beta, i); });
  for (int level = 0; level <= last; ++level)
    with_wanted(targets, memory, level, [&](const auto& wanted) {
      gather_right_hand_side(hierarchy.matrices[level], wanted, beta(level), team,
                             cycle.right_hand_side(level));
      if (level == last) return;
      const LevelMatrix& coarse = hierarchy.matrices[level + 1];
      descend_targets(hierarchy.descents[level], static_cast<int>(coarse.neighbors.size()), wanted, team,
                      memory.wanted[level + 1].as<Float>());
      descend_beta(hierarchy.descents[level], hierarchy.matrices[level], wanted, beta(level), team,
                   beta(level + 1));
    });
  cycle.solve_last_level();
  for (int level = last - 1; level >= 0; --level) {
    with_wanted(targets, memory, level, [&](const auto& wanted) {
      interpolate_along_edges(hierarchy.descents[level], hierarchy.matrices[level], wanted, beta(level),
                              cycle.solution(level + 1), team, cycle.solution(level));
    });
    cycle.improve(level);
  }
}

}  // namespace sinew
