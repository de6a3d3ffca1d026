#pragma once

#include <cstddef>
#include <vector>

#include "solver/coarse_factor.h"

/// Internal to solver/: the parts of the finest level that cycles would leave behind.
namespace sinew {

/// Nodes whose equations are solved together, all others held, in every cycle. No edge joins two patches.
struct Patch {
  std::vector<int> nodes;          ///< ascending
  std::vector<int> offsets = {0};  ///< by node, into neighbors and weights
  std::vector<int> neighbors;      ///< all of the finest level's, in the patch or not
  std::vector<float> weights;      ///< empty when all equal the level's uniform weight
  CoarseFactor factor;
  int first_row = 0;  ///< of CycleMemory::patch_rows

  int size() const { return static_cast<int>(nodes.size()); }
  std::size_t bytes() const;
};

/// Rows of all patches together: they lie one after the other.
inline int row_count(const std::vector<Patch>& patches) {
  return patches.empty() ? 0 : patches.back().first_row + patches.back().size();
}

}  // namespace sinew
