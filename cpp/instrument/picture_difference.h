// SPDX-License-Identifier: MIT
// Differences of two pictures of one size.
#pragma once

#include <cstdint>
#include <string>

#include "render/frame.h"

namespace lodlab::instrument {

/// "1280 x 720".
std::string size_text(const render::Picture& picture);

/// Throws InvalidInput naming the operation unless the picture has four bytes a pixel.
void check_colours(const std::string& operation, const render::Picture& picture);

/// The same for two pictures, which must be of one size.
void check_same_size(const std::string& operation, const render::Picture& a, const render::Picture& b);

/// Peak signal-to-noise ratio of the 8-bit colours (red, green, blue), over the whole picture; decibels,
/// infinite when they are equal.
double psnr_db(const render::Picture& a, const render::Picture& b);

/// Pixels whose depths differ in any bit. Both pictures need depths (else InvalidInput).
int64_t depth_mismatch_pixels(const render::Picture& a, const render::Picture& b);

}  // namespace lodlab::instrument
