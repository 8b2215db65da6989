// SPDX-License-Identifier: MIT
#include "instrument/pixel_error.h"

#include <algorithm>
#include <string>

#include "base/errors.h"
#include "base/parallel.h"
#include "instrument/screen.h"

namespace lodlab::instrument {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// The point that a pixel's centre shows at this distance along the view axis, relative to the eye.
glm::dvec3 unproject(const Camera& camera, int x, int y, double depth) {
  const double right = (x + 0.5 - 0.5 * camera.width) / camera.K,
               up = (0.5 * camera.height - y - 0.5) / camera.K;
  return depth * (camera.forward + right * camera.right + up * camera.up);
}

glm::dvec3 up_at(const SampleGrid& grid, const glm::dvec3& relative, const glm::dvec3& eye) {
  return grid.frame().planet ? glm::normalize(eye + relative) : glm::dvec3(0.0, 0.0, 1.0);
}

void check(const render::Picture& reference, const Camera& camera) {
  const size_t pixels = static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height);
  if (reference.width == camera.width && reference.height == camera.height &&
      reference.depth.size() == pixels)
    return;
  throw InvalidInput("measure: the reference is " + std::to_string(reference.width) + " x " +
                     std::to_string(reference.height) + " with " + std::to_string(reference.depth.size()) +
                     " depths; the view is " + std::to_string(camera.width) + " x " +
                     std::to_string(camera.height));
}

}  // namespace

double interpolated_deviation(const FieldFrame& frame, const DrawnSurface& surface, const glm::dvec2& place) {
  const int64_t last_row = frame.rows - 2, last_col = frame.wraps ? frame.cols - 1 : frame.cols - 2;
  const auto cell = [](double at, int64_t last) {
    return static_cast<int64_t>(std::clamp(std::floor(at), 0.0, static_cast<double>(last)));
  };
  const int64_t row = cell(place.y, last_row), col = cell(place.x, last_col);
  const double u = std::clamp(place.x - static_cast<double>(col), 0.0, 1.0);
  const double v = std::clamp(place.y - static_cast<double>(row), 0.0, 1.0);
  const int64_t next = (col + 1) % frame.cols;
  const auto at = [&](int64_t r, int64_t c) {
    return static_cast<double>(surface.deviation(r * frame.cols + c));
  };
  if ((row + col) % 2 == 0) {  // cut from (row, col) to (row + 1, col + 1)
    const double start = at(row, col), end = at(row + 1, next);
    if (u >= v) return start + (u - v) * (at(row, next) - start) + v * (end - start);
    return start + (v - u) * (at(row + 1, col) - start) + u * (end - start);
  }
  const double east = at(row, next), south = at(row + 1, col);
  if (u + v <= 1.0) return at(row, col) * (1.0 - u - v) + u * east + v * south;
  return at(row + 1, next) * (u + v - 1.0) + (1.0 - v) * east + (1.0 - u) * south;
}

PixelError pixel_error(const HeightField& field, const SampleGrid& grid, const DrawnSurface& surface,
                       const render::Picture& reference, const Camera& camera) {
  check(reference, camera);
  std::vector<double> distances(reference.depth.size(), -1.0);  // -1: nothing there
  parallel_for(camera.height, 8, [&](int64_t begin, int64_t end) {
    for (int64_t y = begin; y < end; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const size_t pixel = static_cast<size_t>(y * camera.width + x);
        const double depth = reference.depth[pixel];
        if (!std::isfinite(depth)) continue;
        const glm::dvec3 point = unproject(camera, x, static_cast<int>(y), depth);
        const double deviation = interpolated_deviation(field, surface, grid.coordinates(point, camera.eye));
        const glm::dvec3 drawn = point + deviation * up_at(grid, point, camera.eye);
        distances[pixel] = std::isnan(deviation) ? kInfinite
                           : deviation == 0.0    ? 0.0
                                                 : screen_distance(camera, point, drawn);
      }
    }
  });
  std::erase(distances, -1.0);
  PixelError out;
  out.pixels = static_cast<int64_t>(distances.size());
  if (distances.empty()) return out;
  double squares = 0.0;
  for (const double distance : distances) squares += distance * distance;
  out.rms = std::sqrt(squares / static_cast<double>(distances.size()));
  const auto rank = distances.begin() + static_cast<int64_t>((distances.size() * 99 + 99) / 100) - 1;
  std::nth_element(distances.begin(), rank, distances.end());
  out.p99 = *rank;
  return out;
}

}  // namespace lodlab::instrument
