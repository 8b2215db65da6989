// SPDX-License-Identifier: MIT
// Screen error over the pixels of a picture. A covered pixel's point comes from the picture's depth; the
// deviation there is that of the three samples of the source's full-resolution triangle (diagonals of the 4-8
// mesh, see geometry/height_field.h) around the point, interpolated linearly. Pictures must have depth and
// the camera's size (else InvalidInput). A pixel whose triangle touches an uncovered sample is a hole.
#pragma once

#include <vector>

#include "geometry/view.h"
#include "instrument/drawn_surface.h"
#include "instrument/pixels.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// From each covered pixel's source point to its correspondent, which lies off it along local up. A hole
/// counts as infinite.
PixelError pixel_error(const HeightField& field, const SampleGrid& grid, const DrawnSurface& surface,
                       const render::Picture& reference, const Camera& camera);

/// The share of the reference's covered pixels at which the drawn surface jumps by more than a pixel from
/// `before` to `after`, of those where both see it; nan when there are none.
double jumping_share(const HeightField& field, const SampleGrid& grid, const DrawnSurface& before,
                     const DrawnSurface& after, const render::Picture& reference, const Camera& camera);

/// Row by row, the screen distance from each drawn point to the source below or above it, pixels: nan where
/// nothing is drawn, inf at a hole.
std::vector<float> error_picture(const HeightField& field, const SampleGrid& grid,
                                 const DrawnSurface& surface, const render::Picture& drawn,
                                 const Camera& camera);

/// The deviation at fractional grid coordinates (col, row), clamped to the field.
double interpolated_deviation(const FieldFrame& frame, const DrawnSurface& surface, const glm::dvec2& place);

}  // namespace lodlab::instrument
