#pragma once

#include <stdexcept>

#include "pipeline/lattice_interior.h"

namespace sinew {

/// Why there are no tetrahedra, as the end of "the tetrahedra worker ...".
class TetgenFailure : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Tetrahedra that keep the surface as it is, about as many nodes as a lattice of constant `spacing` would
/// have.
///
/// They come from the program sinew-tetgen, run under the limits in `options`: TetGen has been seen to crash
/// on damaged surfaces and to corrupt memory. Its answer is checked like a file from a stranger. Edges are
/// those of the tetrahedra, each once. Throws TetgenFailure when the worker is not there, fails, or answers
/// something that is not a filling of this surface.
InteriorNodes fill_with_tetrahedra(const TriMesh& mesh, const Solid& solid, double spacing,
                                   const VolumeGraphOptions& options);

}  // namespace sinew
