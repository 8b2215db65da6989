// SPDX-License-Identifier: MIT
// seamless: what its files give to one another, and the store.
//   meta: pyramid (vertex | average); arrays: layout (patch_log2, resolutions, finest_log2, levels), codes
//   (uint16, all levels' edges, layout.h), scales (double: largest weight, last_error), typical (double, a
//   row of `resolutions` a level); pages: kHeights, one a patch, by its id, the coverage mask, and, with
//   maps, their tiles (method/map_tiles.h) and an array each, colors and normals. A page of heights holds
//   (segments + 1)^2 floats, row by row, clamped lattice points repeated (method/sample_code.h); with
//   pyramid=average it goes on with the (segments / 2 + 1)^2 of the next coarser resolution, and so on.
#pragma once

#include "base/options.h"
#include "geometry/height_rows.h"
#include "methods/seamless/hierarchy.h"
#include "methods/seamless/layout.h"

namespace lodlab::seamless {

enum PageKind : int { kHeights = 0, kCoverage = 1 };

/// A layout over a frame: as many levels as it takes from the last one, whose finest stride is 2^finest_log2,
/// up to one patch.
Layout make_layout(const FieldFrame& frame, int patch_log2, int resolutions, int finest_log2);

/// Floats of a page.
int64_t page_samples(const Layout& layout, bool averaged);

void build(const FieldSource& field, const Options& options, StoreWriter& writer, const Progress& progress);

}  // namespace lodlab::seamless
