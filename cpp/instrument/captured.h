// SPDX-License-Identifier: MIT
// What is asked of captured triangles everywhere: whether they are fillers, and whether they are finite. And
// triangles from elsewhere, as if they had been captured.
#pragma once

#include <cmath>
#include <span>
#include <string>

#include "base/errors.h"
#include "geometry/mesh_surface.h"
#include "instrument/sample_grid.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// Of the three vertices of a triangle.
inline bool is_filler(const render::CapturedVertex* v) {
  return ((v[0].bits | v[1].bits | v[2].bits) & 1u) != 0;
}

inline bool is_finite(const render::CapturedVertex& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

/// InvalidInput for the first vertex of a triangle that is not finite, naming its node.
inline void check_finite(const render::Captured& captured, int64_t triangle) {
  for (int64_t i = 3 * triangle; i < 3 * triangle + 3; ++i) {
    const render::CapturedVertex& v = captured.vertices[static_cast<size_t>(i)];
    if (is_finite(v)) continue;
    throw InvalidInput("measure: node " + std::to_string(v.node) + " drew vertex " + std::to_string(i) +
                       " at (" + std::to_string(v.x) + ", " + std::to_string(v.y) + ", " +
                       std::to_string(v.z) + "); positions must be finite");
  }
}

/// Triangles in source coordinates as a capture from `eye`, all of node 0. `fillers`: one a triangle, not 0
/// where it is one; or empty. InvalidInput, naming the triangle, for a position that is not finite or beyond
/// kFarthestVertex; and where there is none.
render::Captured captured_from(std::span<const Triangle> triangles, std::span<const uint8_t> fillers,
                               const glm::dvec3& eye);

/// Says where on the grid vertices lie, as the shading of a field with voids asks: relative to the eye's
/// cell.
void place_on_grid(render::Captured& captured, const SampleGrid& grid, const Camera& camera);

}  // namespace lodlab::instrument
