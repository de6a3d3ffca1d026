#include "solver/solve_checks.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace sinew {
namespace {

// Whether links lead from every node to an anchored one, as far as asking those that have not heard of one
// some times over tells, in the order of their numbers and back. Where neighbors are near in number two times
// leave hardly any.
bool surely_anchored(const LinearSystem& system) {
  constexpr int most_passes = 64;
  const Graph& graph = system.graph;
  std::vector<char> reached(static_cast<std::size_t>(graph.node_count()), 0);
  std::vector<int> left;
  const auto hears = [&](int node) {
    const std::span<const int> neighbors = graph.neighbors_of(node);
    if (std::none_of(neighbors.begin(), neighbors.end(), [&](int other) { return reached[other] != 0; }))
      return false;
    reached[node] = 1;
    return true;
  };
  for (int node = 0; node < graph.node_count(); ++node) reached[node] = system.anchor[node] > 0 ? 1 : 0;
  for (int node = 0; node < graph.node_count(); ++node)
    if (reached[node] == 0 && !hears(node)) left.push_back(node);
  for (int pass = 0; pass < most_passes && !left.empty(); ++pass) {
    std::reverse(left.begin(), left.end());
    if (std::erase_if(left, hears) == 0) return false;
  }
  return left.empty();
}

}  // namespace

void check_system(const char* solver, const LinearSystem& system) {
  const int n = system.graph.node_count();
  if (system.anchor.size() != n)
    throw std::invalid_argument(std::string(solver) + ": anchor has " + std::to_string(system.anchor.size()) +
                                " entries; expected " + std::to_string(n));
  for (int i = 0; i < n; ++i)
    if (!(system.anchor[i] >= 0) || !std::isfinite(system.anchor[i]))
      throw std::invalid_argument(std::string(solver) + ": anchor of node " + std::to_string(i) + " is " +
                                  std::to_string(system.anchor[i]) + "; expected finite and not negative");
  if (surely_anchored(system)) return;
  const Components components = connected_components(system.graph);
  const std::vector<int> loose = unanchored_components(system, components);
  if (loose.empty()) return;
  const auto first = std::find(components.component.begin(), components.component.end(), loose.front());
  throw std::invalid_argument(std::string(solver) + ": " + std::to_string(loose.size()) + " of " +
                              std::to_string(components.count) +
                              " components hold no anchored node; the first is the one of node " +
                              std::to_string(first - components.component.begin()));
}

void check_workspace_columns(const char* solver, int columns) {
  if (columns < 1)
    throw std::invalid_argument(std::string(solver) + "::make_workspace: columns is " +
                                std::to_string(columns) + "; expected at least 1");
}

void check_shapes(const char* solver, int n, int workspace_columns, const Eigen::Ref<const Columns>& b,
                  const Eigen::Ref<Columns>& x) {
  const auto where = [solver] { return std::string(solver) + "::solve: "; };
  if (b.rows() != n || x.rows() != n || b.cols() != x.cols())
    throw std::invalid_argument(where() + "b is " + std::to_string(b.rows()) + " x " +
                                std::to_string(b.cols()) + " and x " + std::to_string(x.rows()) + " x " +
                                std::to_string(x.cols()) + "; expected " + std::to_string(n) +
                                " rows and as many columns in both");
  if (b.cols() > workspace_columns)
    throw std::invalid_argument(where() + std::to_string(b.cols()) + " columns; the workspace was made for " +
                                std::to_string(workspace_columns));
}

void refuse_correction_workspace(const std::string& name) {
  throw std::invalid_argument(name + "::correct: the workspace was made by another solver");
}

double relative_residual(const LinearSystem& system, const Eigen::Ref<const Columns>& b,
                         const Eigen::Ref<const Columns>& x, Columns& scratch) {
  residual_into(system, b, x, scratch.leftCols(b.cols()));
  double worst = 0;
  for (Eigen::Index column = 0; column < b.cols(); ++column) {
    const double size = b.col(column).norm();
    const double left = scratch.col(column).norm();
    worst = std::max(worst, size > 0 ? left / size : left);
  }
  return worst;
}

}  // namespace sinew
