#pragma once

#include <vector>

#include "pipeline/mesh.h"

namespace sinew::samples {

/// Small closed surfaces, outward, without a vertex twice: for tests, benchmarks and first steps. In metres.

/// Box centred at the origin; each side is cut into `segments` squares of two triangles each way.
TriMesh box(const Eigen::Vector3d& size, int segments);

/// Icosahedron whose triangles are cut in four `subdivisions` times, pushed out to the sphere round
/// the origin: 10 * 4^subdivisions + 2 vertices.
TriMesh sphere(double radius, int subdivisions);

/// Round the y axis: tube of radius `tube_radius` whose middle runs at `ring_radius` from the axis.
TriMesh torus(double ring_radius, double tube_radius, int ring_segments, int tube_segments);

/// Round tube along `axis`, closed by half spheres beyond its ends; `around` vertices round it and
/// as many steps along as keep its faces about square. Bends are mitred: turn less than 120 degrees
/// and keep the pieces longer than the tube is wide.
TriMesh tube(const std::vector<Eigen::Vector3d>& axis, double radius, int around);

/// Capsule from the origin along x: elbow at (length / 2, 0, 0), bent there by `bend` radians up.
TriMesh arm(double length, double radius, double bend, int around);

/// Two legs along y, feet at the bottom, `gap` apart, joined at the top by a pelvis of the same
/// radius. Leg axes at x = -(radius + gap / 2) and radius + gap / 2; y from 0 down to -length.
TriMesh two_legs(double length, double radius, double gap, int around);

}  // namespace sinew::samples
