// SPDX-License-Identifier: MIT
#include "instrument/crack_pixels.h"

#include <algorithm>
#include <cmath>

#include "base/errors.h"
#include "base/parallel.h"
#include "instrument/picture_difference.h"

namespace lodlab::instrument {
namespace {

constexpr double kLeastErosion = 1.0, kMostError = 4.0;
constexpr uint8_t kOutside = 255, kInside = 128;
constexpr int kMostPixels = 16384;

struct Margin {
  int x, y;
};

/// By how much the reference is wider than the cut's picture on each side.
Margin margin_of(const render::Picture& cut, const render::Picture& reference) {
  const int x = reference.width - cut.width, y = reference.height - cut.height;
  if (x >= 0 && y >= 0 && x % 2 == 0 && y % 2 == 0) return {x / 2, y / 2};
  throw InvalidInput("crack_pixels: a reference of " + size_text(reference) +
                     " pixels does not surround a picture of " + size_text(cut));
}

/// Distance along the row to the nearest pixel that is not set, at most `cap`.
void row_distances(const uint8_t* mask, int width, int cap, int* out) {
  int distance = cap;
  for (int x = 0; x < width; ++x) out[x] = distance = mask[x] == 0 ? 0 : std::min(distance + 1, cap);
  distance = cap;
  for (int x = width - 1; x >= 0; --x) {
    distance = mask[x] == 0 ? 0 : std::min(distance + 1, cap);
    out[x] = std::min(out[x], distance);
  }
}

}  // namespace

double erosion_radius(double measured_px_max) {
  return kLeastErosion + (std::isnan(measured_px_max) ? kMostError : std::min(measured_px_max, kMostError));
}

std::vector<uint8_t> erode(const std::vector<uint8_t>& mask, int width, int height, double radius) {
  const int reach = static_cast<int>(std::floor(radius)), cap = reach + 1;
  std::vector<int> distance(mask.size());
  parallel_for(height, 16, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y) row_distances(&mask[y * width], width, cap, &distance[y * width]);
  });
  std::vector<uint8_t> out(mask.size(), 0);
  parallel_for(height, 16, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y) {
      const int64_t lo = std::max<int64_t>(0, y - reach), hi = std::min<int64_t>(height - 1, y + reach);
      for (int x = 0; x < width; ++x) {
        bool keep = true;
        for (int64_t row = lo; row <= hi && keep; ++row) {
          const double across = distance[row * width + x], along = static_cast<double>(row - y);
          keep = across * across + along * along > radius * radius;
        }
        out[y * width + x] = keep ? 1 : 0;
      }
    }
  });
  return out;
}

Camera with_margin(const Camera& camera) {
  Camera out = camera;
  out.width += 2 * std::clamp((kMostPixels - camera.width) / 2, 0, kReferenceMargin);
  out.height += 2 * std::clamp((kMostPixels - camera.height) / 2, 0, kReferenceMargin);
  out.tan_h = camera.tan_h * out.width / camera.width;
  out.tan_v = camera.tan_v * out.height / camera.height;
  out.s = std::sqrt(1.0 + out.tan_h * out.tan_h + out.tan_v * out.tan_v);
  set_planes(out);
  return out;
}

Camera nudged(const Camera& camera, double right, double down) {
  Camera turned = camera;
  turned.forward = glm::normalize(camera.forward + (right * camera.right - down * camera.up) / camera.K);
  turned.right = glm::normalize(glm::cross(turned.forward, camera.up));
  turned.up = glm::cross(turned.right, turned.forward);
  set_planes(turned);
  return turned;
}

void take_back_slivers(render::Picture& cut, const render::Picture& again) {
  for (size_t i = 0; i < cut.rgba.size(); i += 4) {
    if (cut.rgba[i] == kInside && again.rgba[i] == kOutside) cut.rgba[i] = kOutside;
  }
}

CrackPixels crack_pixels(const render::Picture& cut, const render::Picture& reference,
                         double measured_px_max) {
  check_colours("crack_pixels", cut);
  check_colours("crack_pixels", reference);
  const Margin margin = margin_of(cut, reference);
  const auto class_at = [&](int x, int y) {
    return reference.rgba[4 * (static_cast<size_t>(y + margin.y) * reference.width + x + margin.x)];
  };
  std::vector<uint8_t> outside(reference.rgba.size() / 4);
  for (size_t i = 0; i < outside.size(); ++i) outside[i] = reference.rgba[4 * i] == kOutside ? 1 : 0;
  const std::vector<uint8_t> mask =
      erode(outside, reference.width, reference.height, erosion_radius(measured_px_max));
  CrackPixels out;
  int64_t covered = 0, looked_at = 0;
  for (int y = 0; y < cut.height; ++y) {
    for (int x = 0; x < cut.width; ++x) {
      covered += class_at(x, y) != 0 ? 1 : 0;
      if (mask[static_cast<size_t>(y + margin.y) * reference.width + x + margin.x] == 0) continue;
      ++looked_at;
      if (cut.rgba[4 * (static_cast<size_t>(y) * cut.width + x)] != kOutside) ++out.pixels;
    }
  }
  if (covered > 0) out.mask_share = static_cast<double>(looked_at) / static_cast<double>(covered);
  return out;
}

}  // namespace lodlab::instrument
