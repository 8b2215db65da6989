// SPDX-License-Identifier: MIT
// Cracks in the picture: clear colour, or the inside of the surface, seen where the reference shows its
// outside. The reference's silhouette is eroded first, because an approximation may rightly end elsewhere.
// Works on pictures drawn with Show::kClass (red 0 nothing, 128 inside, 255 outside).
#pragma once

#include <cstdint>
#include <vector>

#include "instrument/sample_error.h"
#include "render/frame.h"

namespace lodlab::instrument {

struct CrackPixels {
  int64_t pixels = 0;
  double mask_share = kUndefined;  ///< eroded pixels by covered reference pixels; nan: nothing covered
};

/// The disc that erodes the silhouette, pixels: 1 + min(measured_px_max, 4); an undefined error counts as 4.
double erosion_radius(double measured_px_max);

/// 1 where every pixel centre within `radius` (Euclidean) is set. What lies outside the picture does not
/// erode: a surface goes on past the picture's border.
std::vector<uint8_t> erode(const std::vector<uint8_t>& mask, int width, int height, double radius);

/// Pictures of different sizes throw InvalidInput.
CrackPixels crack_pixels(const render::Picture& cut, const render::Picture& reference,
                         double measured_px_max);

}  // namespace lodlab::instrument
