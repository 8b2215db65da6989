// SPDX-License-Identifier: MIT
// Fillers (skirts and the like) hide cracks: they hang from the surface and never rise above it, or they
// would be a second surface that nobody measures. Compared with the drawn surface, whose vertices they share.
#pragma once

#include <cstdint>

#include "instrument/drawn_surface.h"
#include "instrument/sample_grid.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// Filler triangles with a vertex above the drawn surface: above all samples round its horizontal position,
/// their deviation added, by more than rounding, and no vertex of a surface triangle itself (compared bit for
/// bit). Where the surface has a hole there, nothing is said. Deviations count by size: where two triangles
/// meet, the worse may be the lower one. So a filler may be as far above the source as the surface is off.
int64_t raised_fillers(const HeightField& field, const SampleGrid& grid, const DrawnSurface& surface,
                       const render::Captured& captured);

}  // namespace lodlab::instrument
