// [Shi, Yu, Bell, Feng 2006], sections 4, 5.3 and the appendix. "Elevated" nodes go on to the coarse level,
// "retained" ones do not.
#include "solver/shi_coarsening.h"

#include <algorithm>
#include <cmath>

namespace sinew {
namespace {

/// Nodes before and after, wanted; the paper's hierarchies have about this.
constexpr double kReduction = 5;

double length(const LinearSystem& system, int i, int j) {
  return (system.rest_positions.row(i) - system.rest_positions.row(j)).norm();
}

double mean_edge(const LinearSystem& system) {
  const Graph& graph = system.graph;
  double sum = 0;
  for (int i = 0; i < graph.node_count(); ++i)
    for (int j : graph.neighbors_of(i)) sum += length(system, i, j);
  return graph.neighbors.empty() ? 0 : sum / static_cast<double>(graph.neighbors.size());
}

// coarse_of_fine; -1 for retained nodes.
std::vector<int> elevate(const LinearSystem& system, int& coarse_count) {
  const double delta = mean_edge(system) * std::cbrt(kReduction);
  std::vector<int> coarse_of_fine(static_cast<std::size_t>(system.graph.node_count()), -1);
  coarse_count = 0;
  for (int i = 0; i < system.graph.node_count(); ++i) {
    // An edge is too short unless it is long enough: lengths that are no numbers count as short.
    const auto in_the_way = [&](int j) {
      return coarse_of_fine[j] >= 0 && !(length(system, i, j) >= delta && delta > 0);
    };
    const auto neighbors = system.graph.neighbors_of(i);
    if (std::none_of(neighbors.begin(), neighbors.end(), in_the_way)) coarse_of_fine[i] = coarse_count++;
  }
  return coarse_of_fine;
}

// Sums of a retained node's weights: towards elevated neighbors, and towards all of them.
struct Reach {
  double elevated = 0;  // Z in (14): with the anchor
  double all = 0;       // the denominator of (17)
};

std::vector<Reach> reaches(const LinearSystem& system, const std::vector<int>& coarse_of_fine) {
  const Graph& graph = system.graph;
  std::vector<Reach> result(coarse_of_fine.size());
  for (int i = 0; i < graph.node_count(); ++i) {
    result[i] = {system.anchor[i], system.anchor[i]};
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
      result[i].all += graph.weights[k];
      if (coarse_of_fine[graph.neighbors[k]] >= 0) result[i].elevated += graph.weights[k];
    }
  }
  return result;
}

// One way from an elevated node to another: a direct edge (second entry -1) or over a retained node.
struct Path {
  int target;  // coarse node
  int first_entry;
  int second_entry;
  double weight;
};

std::vector<Path> paths_from(const LinearSystem& system, const std::vector<int>& coarse_of_fine,
                             const std::vector<Reach>& reach, int start) {
  const Graph& graph = system.graph;
  std::vector<Path> paths;
  for (int first = graph.offsets[start]; first < graph.offsets[start + 1]; ++first) {
    const int middle = graph.neighbors[first];
    if (coarse_of_fine[middle] >= 0) {
      paths.push_back({coarse_of_fine[middle], first, -1, graph.weights[first]});
      continue;
    }
    for (int second = graph.offsets[middle]; second < graph.offsets[middle + 1]; ++second) {
      const int end = graph.neighbors[second];
      if (coarse_of_fine[end] < 0 || end == start) continue;
      paths.push_back({coarse_of_fine[end], first, second,
                       graph.weights[first] * graph.weights[second] / reach[middle].elevated});
    }
  }
  std::stable_sort(paths.begin(), paths.end(),
                   [](const Path& l, const Path& r) { return l.target < r.target; });
  return paths;
}

// (19): the coarse edges of one node, and the share each path has in its edge's target (20).
void append_edges(const std::vector<Path>& paths, Graph& coarse, EdgeDescent& descent) {
  for (std::size_t begin = 0; begin < paths.size();) {
    std::size_t end = begin;
    double weight = 0;
    for (; end < paths.size() && paths[end].target == paths[begin].target; ++end) weight += paths[end].weight;
    coarse.neighbors.push_back(paths[begin].target);
    coarse.weights.push_back(weight);
    for (; begin < end; ++begin) {
      descent.first_entries.push_back(paths[begin].first_entry);
      descent.second_entries.push_back(paths[begin].second_entry);
      descent.shares.push_back(static_cast<float>(paths[begin].weight / weight));
    }
    descent.path_offsets.push_back(static_cast<int>(descent.first_entries.size()));
  }
  coarse.offsets.push_back(static_cast<int>(coarse.neighbors.size()));
}

// (21)
double coarse_anchor(const LinearSystem& system, const std::vector<int>& coarse_of_fine,
                     const std::vector<Reach>& reach, int node) {
  const Graph& graph = system.graph;
  double sum = system.anchor[node];
  for (int k = graph.offsets[node]; k < graph.offsets[node + 1]; ++k) {
    const int i = graph.neighbors[k];
    if (coarse_of_fine[i] < 0) sum += graph.weights[k] * system.anchor[i] / reach[i].elevated;
  }
  return sum;
}

void transpose(RowTransfer& transfer) {
  transfer.transposed_offsets.assign(static_cast<std::size_t>(transfer.coarse_count) + 1, 0);
  for (int c : transfer.coarse_nodes) ++transfer.transposed_offsets[c + 1];
  for (int c = 0; c < transfer.coarse_count; ++c)
    transfer.transposed_offsets[c + 1] += transfer.transposed_offsets[c];
  transfer.fine_nodes.resize(transfer.coarse_nodes.size());
  transfer.transposed_values.resize(transfer.coarse_nodes.size());
  std::vector<int> next(transfer.transposed_offsets.begin(), transfer.transposed_offsets.end() - 1);
  for (int i = 0; i + 1 < static_cast<int>(transfer.offsets.size()); ++i)
    for (int k = transfer.offsets[i]; k < transfer.offsets[i + 1]; ++k) {
      const int place = next[transfer.coarse_nodes[k]]++;
      transfer.fine_nodes[place] = i;
      transfer.transposed_values[place] = transfer.values[k];
    }
}

// (17): a retained node's neighbors of its own kind keep what they have.
RowTransfer defect_transfer(const LinearSystem& system, const std::vector<int>& coarse_of_fine,
                            const std::vector<Reach>& reach, int coarse_count) {
  const Graph& graph = system.graph;
  RowTransfer transfer;
  transfer.coarse_count = coarse_count;
  for (int i = 0; i < graph.node_count(); ++i) {
    const bool elevated = coarse_of_fine[i] >= 0;
    transfer.own_share.push_back(elevated ? 0.0f : static_cast<float>(1 / reach[i].all));
    if (elevated) {
      transfer.coarse_nodes.push_back(coarse_of_fine[i]);
      transfer.values.push_back(1.0f);
    } else {
      for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
        if (const int c = coarse_of_fine[graph.neighbors[k]]; c >= 0) {
          transfer.coarse_nodes.push_back(c);
          transfer.values.push_back(static_cast<float>(graph.weights[k] / reach[i].all));
        }
    }
    transfer.offsets.push_back(static_cast<int>(transfer.coarse_nodes.size()));
  }
  transpose(transfer);
  return transfer;
}

}  // namespace

ShiCoarsening coarsen_by_independent_set(const LinearSystem& fine) {
  int coarse_count = 0;
  std::vector<int> coarse_of_fine = elevate(fine, coarse_count);
  const std::vector<Reach> reach = reaches(fine, coarse_of_fine);
  ShiCoarsening result;
  result.defect = defect_transfer(fine, coarse_of_fine, reach, coarse_count);
  LinearSystem& coarse = result.coarse;
  coarse.anchor.resize(coarse_count);
  coarse.rest_positions.resize(coarse_count, 3);
  EdgeDescent& descent = result.descent;
  for (int i = 0; i < fine.graph.node_count(); ++i) {
    descent.anchor.push_back(static_cast<float>(fine.anchor[i]));
    descent.inverse_reach.push_back(coarse_of_fine[i] < 0 ? static_cast<float>(1 / reach[i].elevated) : 0.0f);
    if (coarse_of_fine[i] < 0) continue;
    descent.fine_of_coarse.push_back(i);
    append_edges(paths_from(fine, coarse_of_fine, reach, i), coarse.graph, descent);
    coarse.anchor[coarse_of_fine[i]] = coarse_anchor(fine, coarse_of_fine, reach, i);
    coarse.rest_positions.row(coarse_of_fine[i]) = fine.rest_positions.row(i);
  }
  descent.coarse_of_fine = std::move(coarse_of_fine);
  return result;
}

}  // namespace sinew
