// SPDX-License-Identifier: MIT
#include "instrument/picture_difference.h"

#include <bit>
#include <cmath>
#include <limits>

#include "base/errors.h"

namespace lodlab::instrument {
namespace {

size_t pixels_of(const render::Picture& p) {
  return static_cast<size_t>(p.width) * static_cast<size_t>(p.height);
}

}  // namespace

std::string size_text(const render::Picture& picture) {
  return std::to_string(picture.width) + " x " + std::to_string(picture.height);
}

void check_colours(const std::string& operation, const render::Picture& picture) {
  if (picture.rgba.size() == 4 * pixels_of(picture)) return;
  throw InvalidInput(operation + ": " + std::to_string(picture.rgba.size()) +
                     " colour bytes in a picture of " + size_text(picture) + " pixels");
}

void check_same_size(const std::string& operation, const render::Picture& a, const render::Picture& b) {
  if (a.width != b.width || a.height != b.height) {
    throw InvalidInput(operation + ": pictures of " + size_text(a) + " and " + size_text(b) +
                       " pixels do not compare");
  }
  check_colours(operation, a);
  check_colours(operation, b);
}

double psnr_db(const render::Picture& a, const render::Picture& b) {
  check_same_size("psnr_db", a, b);
  int64_t squares = 0;
  for (size_t i = 0; i < a.rgba.size(); ++i) {
    const int difference = i % 4 == 3 ? 0 : static_cast<int>(a.rgba[i]) - static_cast<int>(b.rgba[i]);
    squares += difference * difference;
  }
  if (squares == 0) return std::numeric_limits<double>::infinity();
  const double mean = static_cast<double>(squares) / (3.0 * static_cast<double>(pixels_of(a)));
  return 10.0 * std::log10(255.0 * 255.0 / mean);
}

int64_t depth_mismatch_pixels(const render::Picture& a, const render::Picture& b) {
  check_same_size("capture_mismatch_pixels", a, b);
  if (a.depth.size() != pixels_of(a) || b.depth.size() != pixels_of(b)) {
    throw InvalidInput("capture_mismatch_pixels: a picture of " + size_text(a) + " pixels has no depth");
  }
  int64_t count = 0;
  for (size_t i = 0; i < a.depth.size(); ++i) {
    count += std::bit_cast<uint32_t>(a.depth[i]) != std::bit_cast<uint32_t>(b.depth[i]) ? 1 : 0;
  }
  return count;
}

}  // namespace lodlab::instrument
