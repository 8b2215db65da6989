// SPDX-License-Identifier: MIT
// How far the drawn surface of a mesh is from its source, in both directions and on screen. The corresponding
// point of a source point is the closest one of the drawn surface.
#pragma once

#include <vector>

#include "geometry/mesh_surface.h"
#include "geometry/view.h"
#include "instrument/sample_error.h"

namespace lodlab::instrument {

/// The distances between two surfaces, `at_source` being closest_to_vertices() of the source. `extent`: of
/// both together. With nothing drawn, what starts at the source is inf, and what starts at the drawn surface
/// nan. See mesh_distance.h for how maxima are found, and for Unsupported.
TwoSided two_sided(const MeshSurface& source, const MeshSurface& drawn, const std::vector<Closest>& at_source,
                   double extent);

/// Work that a maximum between two surfaces may take: minutes.
int64_t most_pieces(const MeshSurface& a, const MeshSurface& b);

/// The largest screen distance, pixels, from vertices inside the frustum to where they are closest; `offset`
/// leads from mesh coordinates to those relative to the eye. nan when none is inside.
double vertex_error_px(const WeldedMesh& from, const std::vector<Closest>& there, const Camera& camera,
                       const glm::dvec3& offset);

}  // namespace lodlab::instrument
