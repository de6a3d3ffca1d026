#pragma once

#include <cstddef>
#include <cstdint>
#include <iosfwd>
#include <memory>
#include <vector>

#include "solver/laplacian.h"
#include "solver/thread_team.h"

namespace sinew {

/// Where the coarse levels come from.
enum class Coarsening {
  lattice,  ///< trilinear interpolation from lattices, Galerkin products (the default)
  shi2006,  ///< delta-independent sets and the closed forms (19)-(22) of [Shi et al. 2006], defects carried
            ///< by (17); one coarse matrix, that of (19) and (21), serves both equations
};

struct HierarchyOptions {
  Coarsening coarsening = Coarsening::lattice;
  int coarsest_size = 2000;  ///< nodes; a level this small is solved directly
  int max_levels = 12;       ///< stop here even if still large; the printed table says so
};

/// What one level is made of; level 0 is the finest.
struct LevelSummary {
  int nodes = 0;
  std::int64_t entries = 0;  ///< off-diagonal matrix entries stored, both directions
  std::size_t bytes = 0;
};

/// Coarser and coarser copies of a system, with the transfers between them. Immutable.
class Hierarchy {
 public:
  Hierarchy(const LinearSystem& system, const HierarchyOptions& options, ThreadTeam& team);
  ~Hierarchy();
  Hierarchy(Hierarchy&&) noexcept;
  Hierarchy& operator=(Hierarchy&&) noexcept;

  std::vector<LevelSummary> levels() const;
  std::size_t bytes() const;

  struct Members;  ///< flat arrays, defined in hierarchy_levels.h for the solver's own files
  const Members& members() const { return *members_; }

 private:
  std::unique_ptr<Members> members_;
};

/// Table of levels: nodes, entries, bytes, operator complexity.
std::ostream& operator<<(std::ostream& out, const Hierarchy& hierarchy);

}  // namespace sinew
