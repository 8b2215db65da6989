// SPDX-License-Identifier: MIT
// Cracks in the picture: clear colour, or the inside of the surface, seen where the reference shows its
// outside. The reference's silhouette is eroded first, because an approximation may rightly end elsewhere.
// Works on pictures drawn with Show::kClass (red 0 nothing, 128 inside, 255 outside). The reference is drawn
// a margin wider on each side, because a silhouette just outside the picture erodes it as well.
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

/// 1 where every pixel centre within `radius` (Euclidean) is set. What lies outside the mask does not erode.
std::vector<uint8_t> erode(const std::vector<uint8_t>& mask, int width, int height, double radius);

/// Pixels by which the reference is wider on each side: more than any erosion_radius().
inline constexpr int kReferenceMargin = 6;

/// The camera of the reference's classes: the same rays, and a margin of pixels around them (less where
/// the picture would pass 16384 pixels).
Camera with_margin(const Camera& camera);

/// The same camera turned by a fraction of a pixel to the right and down (at the centre of the picture).
Camera nudged(const Camera& camera, double right, double down);

/// Takes back inside pixels of `cut` where `again` shows the outside. Near the edge of a ridge the
/// rasterizer's own grid (1/256 pixel) lets a far slope through where the near one ends within that grid;
/// seen from a camera nudged by kNudge pixels it is gone, and a crack of twice that width is not.
void take_back_slivers(render::Picture& cut, const render::Picture& again);
inline constexpr double kNudge = 1.0 / 64.0;

/// `reference` is as large as `cut`, or wider by an equal margin on opposite sides; else InvalidInput.
CrackPixels crack_pixels(const render::Picture& cut, const render::Picture& reference,
                         double measured_px_max);

}  // namespace lodlab::instrument
