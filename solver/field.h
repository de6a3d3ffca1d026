#pragma once

#include <Eigen/Core>

namespace sinew {

/// One number per node.
using Field = Eigen::VectorXd;

/// One x y z per node: n x 3, row-major, so that a node's three numbers lie together.
using Field3 = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// Several numbers per node, solved side by side: n x k, row-major.
using Columns = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

}  // namespace sinew
