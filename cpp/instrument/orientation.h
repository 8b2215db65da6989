// SPDX-License-Identifier: MIT
// Which way captured triangles face. The surface of a height field is wound counter-clockwise seen from
// outside (above; on planets away from the centre), and its fillers are vertical: they have no horizontal
// area, so that none of them can pass for surface. Both beyond what the rounding of positions explains.
#pragma once

#include <cstdint>

#include "instrument/sample_grid.h"
#include "render/frame.h"

namespace lodlab::instrument {

struct Orientation {
  int64_t inverted = 0;         ///< surface triangles that show their inside to the outside
  int64_t slanted_fillers = 0;  ///< fillers that are not vertical
};

Orientation orientation(const SampleGrid& grid, const render::Captured& captured);

}  // namespace lodlab::instrument
