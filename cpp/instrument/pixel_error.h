// SPDX-License-Identifier: MIT
// Errors at the pixels of a picture: each pixel's point and where it corresponds to. On every kind of source.
#pragma once

#include <vector>

#include "geometry/view.h"
#include "instrument/pixels.h"
#include "instrument/ruler.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// From each covered pixel's source point to its correspondent on the drawn surface. Nothing there counts as
/// infinite.
PixelError pixel_error(const Correspondence& to_drawn, const render::Picture& reference,
                       const Camera& camera);

/// The share of the reference's covered pixels at which the drawn surface jumps by more than a pixel from
/// `before` to `after`, of those where both see it; nan when there are none.
double jumping_share(const Correspondence& before, const Correspondence& after,
                     const render::Picture& reference, const Camera& camera);

/// Row by row, the screen distance from each drawn point to its correspondent on the source, pixels: nan
/// where nothing is drawn, inf where there is none.
std::vector<float> error_picture(const Correspondence& to_source, const render::Picture& drawn,
                                 const Camera& camera);

}  // namespace lodlab::instrument
