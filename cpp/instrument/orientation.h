// SPDX-License-Identifier: MIT
// Which way captured triangles face. The surface of a height field is wound counter-clockwise seen from
// outside (above; on planets away from the centre), and its fillers are vertical: they have no horizontal
// area, so that none of them can pass for surface. A piece drawn of a mesh faces as the source does where
// they are closest. All beyond what the rounding of positions explains.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <optional>

#include "geometry/mesh_surface.h"
#include "instrument/sample_error.h"
#include "instrument/sample_grid.h"
#include "render/frame.h"

namespace lodlab::instrument {

struct Orientation {
  int64_t inverted = 0;                    ///< surface triangles that show their inside to the outside
  std::optional<int64_t> slanted_fillers;  ///< fillers that are not vertical; nothing where there is no up
};

Orientation orientation(const SampleGrid& grid, const render::Captured& captured);

/// Beside a mesh, `centre` being where its coordinates are from. A triangle faces against the source where it
/// is within the bound of its node of the triangle's middle, faces the other way where it is closest, and
/// faces the triangle's way nowhere within that bound: of a sheet thinner than the bound nothing is said.
/// Inverted are the triangles of a piece, all joined across edges that they run along in opposite senses, of
/// which more faces against than with: a fold is none.
Orientation orientation(const MeshSurface& source, const glm::dvec3& centre, const render::Captured& captured,
                        const NodeBound& bound);

}  // namespace lodlab::instrument
