// SPDX-License-Identifier: MIT
// Which way captured triangles face. The surface of a height field is wound counter-clockwise seen from
// outside (above; on planets away from the centre), and its fillers are vertical: they have no horizontal
// area, so that none of them can pass for surface. A triangle drawn of a mesh faces as the source does where
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

/// Beside a mesh, `centre` being where its coordinates are from. A triangle is inverted where the source is
/// within the bound of its node of its middle, faces the other way where it is closest, and faces its way
/// nowhere within that bound: of a sheet thinner than the bound nothing is said.
Orientation orientation(const MeshSurface& source, const glm::dvec3& centre, const render::Captured& captured,
                        const NodeBound& bound);

}  // namespace lodlab::instrument
