// SPDX-License-Identifier: MIT
#include "instrument/crack_pixels.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/mesh_surface.h"
#include "instrument/picture_difference.h"

namespace lodlab::instrument {
namespace {

constexpr double kLeastErosion = 1.0;
constexpr uint8_t kOutside = 255, kInside = 128;
constexpr int kMostPixels = 16384;

/// Distance along the row to the nearest pixel that is not set, or out of the row; at most `cap`.
void row_distances(const uint8_t* mask, int width, int cap, int* out) {
  int distance = 0;
  for (int x = 0; x < width; ++x) out[x] = distance = mask[x] == 0 ? 0 : std::min(distance + 1, cap);
  distance = 0;
  for (int x = width - 1; x >= 0; --x) {
    distance = mask[x] == 0 ? 0 : std::min(distance + 1, cap);
    out[x] = std::min(out[x], distance);
  }
}

/// Whether a ray from the origin meets a triangle; one that it lies in counts as missed.
bool meets(const Triangle& t, const glm::dvec3& way) {
  const glm::dvec3 normal = glm::cross(t[1] - t[0], t[2] - t[0]);
  const double facing = glm::dot(normal, way);
  if (facing == 0.0 || glm::dot(normal, t[0]) / facing < 0.0) return false;
  double least = 0.0, most = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double side = glm::dot(way, glm::cross(t[i], t[(i + 1) % 3]));
    least = std::min(least, side);
    most = std::max(most, side);
  }
  return least == 0.0 || most == 0.0;
}

}  // namespace

double erosion_radius(double error_px) { return kLeastErosion + (std::isnan(error_px) ? 0.0 : error_px); }

std::vector<uint8_t> erode(const std::vector<uint8_t>& mask, int width, int height, double radius) {
  radius = std::min(radius, static_cast<double>(width + height));  // from half of that on nothing is left
  const int reach = static_cast<int>(std::floor(radius));
  std::vector<int> distance(mask.size());
  parallel_for(height, 16, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y) {
      row_distances(&mask[y * width], width, reach + 1, &distance[y * width]);
    }
  });
  // In its own column a clear pixel `d` columns away erodes the rows up to rows_at[d] above and below its
  // own.
  std::vector<int> rows_at(static_cast<size_t>(reach) + 1);
  for (int d = 0; d <= reach; ++d)
    rows_at[d] = static_cast<int>(std::floor(std::sqrt(radius * radius - 1.0 * d * d)));
  std::vector<int> begun(mask.size(), 0);  // by row: how many such spans begin there, less those that ended
  std::vector<uint8_t> out(mask.size(), 0);
  parallel_for(width, 64, [&](int64_t left, int64_t right) {
    for (int64_t y = 0; y < height; ++y) {
      for (int64_t x = left; x < right; ++x) {
        const int d = distance[y * width + x];
        if (d > reach) continue;
        const int64_t first = std::max<int64_t>(0, y - rows_at[d]), end = y + rows_at[d] + 1;
        ++begun[first * width + x];
        if (end < height) --begun[end * width + x];
      }
    }
    for (int64_t y = 0; y < height; ++y) {
      for (int64_t x = left; x < right; ++x) {
        if (y > 0) begun[y * width + x] += begun[(y - 1) * width + x];
        out[y * width + x] = begun[y * width + x] == 0 && y >= reach && y < height - reach ? 1 : 0;
      }
    }
  });
  return out;
}

Camera with_margin(const Camera& camera) {
  Camera out = camera;
  out.width += 2 * std::clamp((kMostPixels - camera.width) / 2, 0, kClassMargin);
  out.height += 2 * std::clamp((kMostPixels - camera.height) / 2, 0, kClassMargin);
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

void leave_out_voids(render::Picture& classes, const render::Picture& seen) {
  for (size_t i = 0; i < classes.depth.size(); ++i) {
    if (classes.rgba[4 * i] == kOutside && classes.depth[i] != seen.depth[i]) classes.rgba[4 * i] = kInside;
  }
}

void keep_margin(std::vector<float>& depth, const Camera& wide, const Camera& camera) {
  const int left = (wide.width - camera.width) / 2, top = (wide.height - camera.height) / 2;
  for (int y = top; y < top + camera.height; ++y) {
    const auto row = depth.begin() + static_cast<int64_t>(y) * wide.width + left;
    std::fill(row, row + camera.width, std::numeric_limits<float>::infinity());
  }
}

void take_back_slivers(render::Picture& cut, const render::Picture& again) {
  for (size_t i = 0; i < cut.rgba.size(); i += 4) {
    if (cut.rgba[i] == kInside && again.rgba[i] == kOutside) cut.rgba[i] = kOutside;
  }
}

bool stands_free(const render::Captured& captured, const Camera& camera, const glm::dvec3& up) {
  const double reach = camera.near_plane * camera.s;
  std::atomic<bool> free = true;
  parallel_for(captured.triangles(), 16384, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end && free; ++i) {
      const render::CapturedVertex* v = &captured.vertices[static_cast<size_t>(3 * i)];
      const Triangle t{{{v[0].x, v[0].y, v[0].z}, {v[1].x, v[1].y, v[1].z}, {v[2].x, v[2].y, v[2].z}}};
      if (meets(t, up) || closest_on_triangle(t, glm::dvec3(0.0)).distance <= reach) free = false;
    }
  });
  return free;
}

CrackPixels crack_pixels(const render::Picture& cut, const render::Picture& reference, int width, int height,
                         double error_px) {
  check_same_size("crack_pixels", cut, reference);
  if (width > reference.width || height > reference.height) {
    throw InvalidInput("crack_pixels: pictures of " + size_text(reference) + " pixels have no middle of " +
                       std::to_string(width) + " x " + std::to_string(height));
  }
  const int left = (reference.width - width) / 2, top = (reference.height - height) / 2;
  std::vector<uint8_t> outside(reference.rgba.size() / 4);
  for (size_t i = 0; i < outside.size(); ++i) outside[i] = reference.rgba[4 * i] == kOutside ? 1 : 0;
  const std::vector<uint8_t> mask =
      erode(outside, reference.width, reference.height, erosion_radius(error_px));
  CrackPixels out;
  int64_t covered = 0, looked_at = 0, cracks = 0;
  for (int y = top; y < top + height; ++y) {
    for (int x = left; x < left + width; ++x) {
      const size_t pixel = static_cast<size_t>(y) * reference.width + x;
      covered += reference.rgba[4 * pixel] != 0 ? 1 : 0;
      if (mask[pixel] == 0) continue;
      ++looked_at;
      cracks += cut.rgba[4 * pixel] != kOutside ? 1 : 0;
    }
  }
  if (covered > 0) out.mask_share = static_cast<double>(looked_at) / static_cast<double>(covered);
  if (out.mask_share >= kLeastMaskShare) out.pixels = static_cast<double>(cracks);
  return out;
}

}  // namespace lodlab::instrument
