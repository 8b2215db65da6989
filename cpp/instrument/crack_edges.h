// SPDX-License-Identifier: MIT
// Cracks in the captured surface triangles, fillers left out. Triangles with two bit-equal vertices are
// dropped; then every directed edge (a, b) must have exactly one (b, a), bit for bit (-0 equals 0),
// but for the source's own boundary. No slack: a vertex that differs in its last bit is a crack. Where floats
// do not part the columns of a planet, two that fall together fold what is between: there as many opposites
// do.
#pragma once

#include <cstdint>

#include "instrument/sample_grid.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// The number of directed edges without exactly one opposite. Edges along the outer border of the grid
/// (a planet that wraps has no first and last column, and none along a pole) are not counted.
int64_t crack_edges(const SampleGrid& grid, const render::Captured& captured);

}  // namespace lodlab::instrument
