// SPDX-License-Identifier: MIT
// Polygons in space as triangles: a fan from the first corner where that is right, as on every convex
// polygon, else ears cut off (Meisters 1975) in the plane that Newell's normal gives.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "geometry/mesh.h"

namespace lodlab {

/// Polygons of more corners than this become fans unseen: cutting ears takes the square of their number.
inline constexpr int64_t kMostCorners = 1000;

/// `sizes[i]` corners each, one polygon's after the other's, as indices of positions; polygons of fewer than
/// three give nothing.
std::vector<Face> polygon_triangles(std::span<const glm::dvec3> positions, std::span<const uint32_t> corners,
                                    std::span<const int64_t> sizes);

}  // namespace lodlab
