// SPDX-License-Identifier: MIT
// A sphere without pole slivers: a cube's surface, each face a grid of `size` x `size` points, neighbours
// sharing the points of their edges, blown up so that cells are of nearly equal angle. And the blob, the same
// with fractal noise as its radius. Nothing but +, *, / and square roots of doubles, so that every machine
// agrees.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "geometry/mesh.h"

namespace lodlab {

/// The most points of a cube's edge: 6 (size - 1)^2 * 2 triangles are within kMostFaces.
inline constexpr int64_t kLargestCubeSphere = 7000;

struct CubeSphere {
  std::vector<glm::dvec3> directions;  ///< 6 (size - 1)^2 + 2 points of the unit sphere
  std::vector<Face> faces;             ///< 12 (size - 1)^2, counter-clockwise from outside
};

/// InvalidInput for a size outside 2 to kLargestCubeSphere.
CubeSphere cube_sphere(int64_t size);

/// Displaces directions into a closed surface round the origin, radius about 1: gradient noise (Perlin 2002)
/// in octaves down to a wavelength of `finest` (an angle). Coordinates are rounded to 32-bit floats.
void displace_into_blob(std::vector<glm::dvec3>& directions, uint64_t seed, double finest);

}  // namespace lodlab
