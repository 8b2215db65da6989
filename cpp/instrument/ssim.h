// SPDX-License-Identifier: MIT
// Structural similarity: Wang, Bovik, Sheikh and Simoncelli, "Image quality assessment: from error visibility
// to structural similarity", IEEE Transactions on Image Processing 13(4), 2004. Gaussian windows of 11 x 11
// pixels (sigma 1.5), K1 = 0.01, K2 = 0.03, moments of the population; mean over the windows that the border
// does not cut, and over red, green and blue.
#pragma once

#include "render/frame.h"

namespace lodlab::instrument {

/// 1 for equal pictures; nan where a side is shorter than the window. InvalidInput for pictures of two sizes.
double ssim(const render::Picture& a, const render::Picture& b);

}  // namespace lodlab::instrument
