#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "pipeline/rig.h"
#include "skeleton/pose.h"
#include "solver/edge_targets.h"

namespace sinew {

/// One linear system of a real frame, with its answer: what the solvers are compared on.
struct PosedSystem {
  std::string name;                    ///< of the mesh
  LinearSystem system;                 ///< over the free nodes
  Columns b;                           ///< n x 3: the frame's right-hand side [Shi et al. 2006, eq. 11]
  Columns exact;                       ///< n x 3: the answer, to a relative residual of 1e-10
  Field3 beta;                         ///< n x 3: what the constrained neighbors add to b
  std::vector<Eigen::Matrix3f> turns;  ///< n: scale times rotation of each free node
  double diagonal = 1.0;               ///< of the rest body's bounding box

  int size() const { return system.graph.node_count(); }
};

/// The system that `rig` solves for `pose` in the first pass of a frame, relative to the pose's first
/// joint. The rig must have a solver. Throws std::runtime_error when the tight solve does not converge.
PosedSystem pose_system(const Rig& rig, const Pose& pose, const std::string& name, ThreadTeam& team);

/// The same right-hand side as what its edges want: b = beta + sum of w * wanted.
EdgeTargets edge_targets(const PosedSystem& posed);

/// To and from a file of this machine's byte order, for another process. Throws std::runtime_error naming
/// the file.
void write_posed_system(const std::filesystem::path& file, const PosedSystem& posed);
PosedSystem read_posed_system(const std::filesystem::path& file);

/// The largest distance of a node from where `exact` has it, as a share of the diagonal.
double vertex_error(const PosedSystem& posed, const Columns& x);

}  // namespace sinew
