#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "io/gltf_document.h"

namespace sinew {

/// World matrices of all nodes (index: node) from local transforms (index: node). A node that the file
/// places by a matrix keeps that very matrix.
std::vector<Eigen::Affine3d> node_worlds(const GltfDocument& document, const std::vector<Transform>& local);

/// All nodes where the file puts them when nothing is animated.
std::vector<Transform> rest_locals(const GltfDocument& document);

/// One animation, decoded: every node's placement at any time.
class GltfTracks {
 public:
  /// Throws FileError (malformed) when key times do not increase from 0 or later, and for rotations
  /// without length.
  GltfTracks(const GltfDocument& document, int animation);

  double seconds() const { return seconds_; }  ///< the last key of any channel
  const std::vector<std::string>& warnings() const { return warnings_; }

  /// Local transforms of all nodes; before a channel's first key and after its last the value there
  /// holds, and what no channel moves stays at rest. `seconds` finite.
  std::vector<Transform> locals(double seconds) const;
  std::vector<Eigen::Affine3d> worlds(double seconds) const {
    return node_worlds(document_, locals(seconds));
  }

 private:
  struct Track {
    int node = 0;
    GltfPath path = GltfPath::translation;
    GltfInterpolation interpolation = GltfInterpolation::linear;
    std::vector<double> times;   ///< strictly increasing
    std::vector<double> values;  ///< per key `components()` numbers; cubic: in-tangent, value, out-tangent
    int components() const { return path == GltfPath::rotation ? 4 : 3; }
    Eigen::Vector4d key(std::size_t index) const;
    Eigen::Vector4d at(double seconds) const;
  };

  Track decode(const GltfSampler& sampler, const GltfChannel& channel, const std::string& where) const;

  const GltfDocument& document_;
  std::vector<Track> tracks_;
  std::vector<std::string> warnings_;
  double seconds_ = 0.0;
};

}  // namespace sinew
