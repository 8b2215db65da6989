// SPDX-License-Identifier: MIT
// Screen error over the pixels of the reference picture. A covered pixel's source point comes from the
// reference depth; its correspondent lies off it, along local up, by the drawn surface's deviation there:
// that of the three samples of the source's full-resolution triangle (diagonals of the 4-8 mesh, see
// geometry/height_field.h) around the point, interpolated linearly.
#pragma once

#include "geometry/view.h"
#include "instrument/drawn_surface.h"
#include "instrument/sample_error.h"
#include "render/frame.h"

namespace lodlab::instrument {

struct PixelError {
  double p99 = kUndefined;  ///< the value that 99 % of the covered pixels do not exceed (nearest rank)
  double rms = kUndefined;
  int64_t pixels = 0;  ///< covered pixels; nan above when there are none
};

/// `reference` is the reference's picture with depth, of the camera's size (else InvalidInput). A pixel
/// whose triangle touches an uncovered sample counts as infinite.
PixelError pixel_error(const HeightField& field, const SampleGrid& grid, const DrawnSurface& surface,
                       const render::Picture& reference, const Camera& camera);

/// The deviation at fractional grid coordinates (col, row), clamped to the field.
double interpolated_deviation(const FieldFrame& frame, const DrawnSurface& surface, const glm::dvec2& place);

}  // namespace lodlab::instrument
