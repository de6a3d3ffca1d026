// After [Shi et al. 2006], section 2.2.
#include "solver/laplacian.h"

#include <stdexcept>
#include <string>

namespace sinew {
namespace {

SparseMatrix graph_matrix(const Graph& graph, const Field* anchor) {
  const int n = graph.node_count();
  SparseMatrix A(n, n);
  if (n == 0) return A;  // Eigen 3.4 reads behind the rows of an empty matrix
  Eigen::VectorXi row_sizes(n);
  for (int i = 0; i < n; ++i) row_sizes[i] = graph.degree(i) + 1;
  A.reserve(row_sizes);
  for (int i = 0; i < n; ++i) {
    double diagonal = anchor != nullptr ? (*anchor)[i] : 0.0;
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k) {
      diagonal += graph.weights[k];
      A.insert(i, graph.neighbors[k]) = -graph.weights[k];
    }
    A.insert(i, i) = diagonal;
  }
  A.makeCompressed();
  return A;
}

// A fixed number of columns keeps a node's sums in registers; one block of columns at a time.
template <int kColumns>
void residual_columns(const LinearSystem& system, const Eigen::Ref<const Columns>& b,
                      const Eigen::Ref<const Columns>& x, Eigen::Ref<Columns> out, Eigen::Index first) {
  const Graph& graph = system.graph;
  for (int i = 0; i < graph.node_count(); ++i) {
    const auto xi = x.row(i).segment<kColumns>(first);
    Eigen::Matrix<double, 1, kColumns> sum = b.row(i).segment<kColumns>(first) - system.anchor[i] * xi;
    for (int k = graph.offsets[i]; k < graph.offsets[i + 1]; ++k)
      sum -= graph.weights[k] * (xi - x.row(graph.neighbors[k]).segment<kColumns>(first));
    out.row(i).segment<kColumns>(first) = sum;
  }
}

void check_shape(const char* name, Eigen::Index rows, Eigen::Index columns, Eigen::Index n, Eigen::Index k) {
  if (rows == n && columns == k) return;
  throw std::invalid_argument("residual: " + std::string(name) + " is " + std::to_string(rows) + " x " +
                              std::to_string(columns) + "; expected " + std::to_string(n) + " x " +
                              std::to_string(k));
}

}  // namespace

SparseMatrix laplacian(const Graph& graph) {
  return graph_matrix(graph, nullptr);
}

SparseMatrix matrix(const LinearSystem& system) {
  if (system.anchor.size() != system.graph.node_count())
    throw std::invalid_argument("matrix: anchor has " + std::to_string(system.anchor.size()) +
                                " entries; expected " + std::to_string(system.graph.node_count()));
  return graph_matrix(system.graph, &system.anchor);
}

std::vector<int> unanchored_components(const LinearSystem& system, const Components& components) {
  std::vector<char> anchored(static_cast<std::size_t>(components.count), 0);
  for (int i = 0; i < system.graph.node_count(); ++i)
    if (system.anchor[i] > 0) anchored[components.component[i]] = 1;
  std::vector<int> result;
  for (int c = 0; c < components.count; ++c)
    if (!anchored[c]) result.push_back(c);
  return result;
}

void residual(const LinearSystem& system, const Eigen::Ref<const Columns>& b,
              const Eigen::Ref<const Columns>& x, Columns& out) {
  out.resize(b.rows(), b.cols());
  residual_into(system, b, x, out);
}

void residual_into(const LinearSystem& system, const Eigen::Ref<const Columns>& b,
                   const Eigen::Ref<const Columns>& x, Eigen::Ref<Columns> out) {
  const Eigen::Index n = system.graph.node_count();
  check_shape("b", b.rows(), b.cols(), n, b.cols());
  check_shape("x", x.rows(), x.cols(), n, b.cols());
  check_shape("out", out.rows(), out.cols(), n, b.cols());
  Eigen::Index column = 0;
  for (; column + 4 <= b.cols(); column += 4) residual_columns<4>(system, b, x, out, column);
  if (column + 3 <= b.cols()) {
    residual_columns<3>(system, b, x, out, column);
    column += 3;
  }
  for (; column < b.cols(); ++column) residual_columns<1>(system, b, x, out, column);
}

}  // namespace sinew
