// SPDX-License-Identifier: MIT
// Cracks in the picture: clear colour, or the inside of the surface, seen where the reference shows its
// outside. The reference's silhouette is eroded first by the largest error that any pixel sees, because an
// approximation may rightly end elsewhere; where next to nothing is left, nothing is decided. (A cut's own
// pixels are asked only where something shows: they see what moved into sight.)
// Works on pictures drawn with Show::kClass (red 0 nothing, 128 inside, 255 outside), the cut's and the
// reference's with one camera, so that equal surfaces make equal pictures. It is a margin wider on each side,
// because a silhouette just outside the picture erodes it as well. Voids are filled in it (or a hole that
// relief hides in one picture, and a lower ridge shows in the other, were a crack), but nothing is known of
// errors there.
#pragma once

#include <cstdint>
#include <vector>

#include "instrument/sample_error.h"
#include "render/frame.h"

namespace lodlab::instrument {

struct CrackPixels {
  double pixels = kUndefined;      ///< nan: not decided
  double mask_share = kUndefined;  ///< eroded pixels by covered reference pixels; nan: nothing covered
};

/// Below this share of the covered pixels nothing is said of the rest.
inline constexpr double kLeastMaskShare = 0.1;

/// The disc that erodes the silhouette, pixels, where no pixel sees a larger (finite) error.
double erosion_radius(double error_px);

/// 1 where every pixel centre within `radius` (Euclidean) is set. Nothing is set outside the mask.
std::vector<uint8_t> erode(const std::vector<uint8_t>& mask, int width, int height, double radius);

/// Pixels by which the pictures of classes are wider on each side.
inline constexpr int kClassMargin = 6;

/// The camera of the classes: the same rays, and a margin of pixels around them (less where the picture would
/// pass 16384 pixels).
Camera with_margin(const Camera& camera);

/// The same camera turned by a fraction of a pixel to the right and down (at the centre of the picture).
Camera nudged(const Camera& camera, double right, double down);

/// Takes the outside back where `classes` show a filled void: where `seen`, the same view with its voids
/// empty, has another depth.
void leave_out_voids(render::Picture& classes, const render::Picture& seen);

/// Empties the middle of the depths of `wide`, which `camera` sees: its own picture has them.
void keep_margin(std::vector<float>& depth, const Camera& wide, const Camera& camera);

/// Takes back inside pixels of `cut` where `again` shows the outside. Near the edge of a ridge the
/// rasterizer's own grid (1/256 pixel) lets a far slope through where the near one ends within that grid;
/// seen from a camera nudged by kNudge pixels it is gone, and a crack of twice that width is not.
void take_back_slivers(render::Picture& cut, const render::Picture& again);
inline constexpr double kNudge = 1.0 / 64.0;

/// Whether the drawn surface leaves the eye free: nothing of it is as near as the near plane's corners, and
/// nothing hangs over the eye. Otherwise its inside shows, or what lies behind it, and is no crack. `up` is
/// local up there.
bool stands_free(const render::Captured& captured, const Camera& camera, const glm::dvec3& up);

/// Of the middle of two pictures of one size (else InvalidInput), `width` x `height` pixels. `error_px`: the
/// largest finite error that a pixel of the reference sees, margin included; nan where none sees any.
CrackPixels crack_pixels(const render::Picture& cut, const render::Picture& reference, int width, int height,
                         double error_px);

}  // namespace lodlab::instrument
