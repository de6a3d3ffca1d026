#pragma once

#include "solver/field.h"

namespace sinew {

/// The right-hand side of a LinearSystem as what it is made of: what every edge wants, and what the
/// constrained nodes ask for [Shi et al. 2006, eq. 11]: b_i = beta_i + sum_j w(i,j) wanted(i,j).
struct EdgeTargets {
  Field3 wanted;  ///< one row per entry of graph.neighbors: for j in the row of i, the wanted x_i - x_j; the
                  ///< entry of i in the row of j is its negative
  Field3 beta;    ///< n x 3: sum over constrained neighbors c of w(i,c) (x_c + wanted x_i - x_c)
};

}  // namespace sinew
