// SPDX-License-Identifier: MIT
#include "instrument/pixel_error.h"

#include <algorithm>

#include "instrument/screen.h"

namespace lodlab::instrument {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

/// Calls `distance(point, place, up)` at every covered pixel: the point relative to the eye, its fractional
/// (column, row), local up there. Row by row; kNothing where the picture is empty.
template <class Distance>
std::vector<double> at_pixels(const SampleGrid& grid, const render::Picture& picture, const Camera& camera,
                              const Distance& distance) {
  return over_pixels(picture, camera, [&](const glm::dvec3& point) {
    return distance(point, grid.coordinates(point, camera.eye), up_at(grid, point, camera.eye));
  });
}

/// From a point to where it lies after a displacement; no displacement is no distance, whatever rounding
/// does.
double moved(const Camera& camera, const glm::dvec3& point, const glm::dvec3& displacement) {
  return displacement == glm::dvec3(0.0) ? 0.0 : screen_distance(camera, point, point + displacement);
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
  return summarize(at_pixels(
      grid, reference, camera, [&](const glm::dvec3& point, const glm::dvec2& place, const glm::dvec3& up) {
        const double deviation = interpolated_deviation(field, surface, place);
        return std::isnan(deviation) ? kInfinite : moved(camera, point, deviation * up);
      }));
}

double jumping_share(const HeightField& field, const SampleGrid& grid, const DrawnSurface& before,
                     const DrawnSurface& after, const render::Picture& reference, const Camera& camera) {
  const std::vector<double> distances = at_pixels(
      grid, reference, camera, [&](const glm::dvec3& point, const glm::dvec2& place, const glm::dvec3& up) {
        const double from = interpolated_deviation(field, before, place);
        const double to = interpolated_deviation(field, after, place);
        if (std::isnan(from) || std::isnan(to)) return kNothing;
        return moved(camera, point + from * up, (to - from) * up);
      });
  int64_t seen = 0, jumped = 0;
  for (const double distance : distances) {
    seen += distance >= 0.0 ? 1 : 0;
    jumped += distance > 1.0 ? 1 : 0;
  }
  return seen == 0 ? kUndefined : static_cast<double>(jumped) / static_cast<double>(seen);
}

std::vector<float> error_picture(const HeightField& field, const SampleGrid& grid,
                                 const DrawnSurface& surface, const render::Picture& drawn,
                                 const Camera& camera) {
  const std::vector<double> distances = at_pixels(
      grid, drawn, camera, [&](const glm::dvec3& point, const glm::dvec2& place, const glm::dvec3& up) {
        const double deviation = interpolated_deviation(field, surface, place);
        return std::isnan(deviation) ? kInfinite : moved(camera, point, -deviation * up);
      });
  std::vector<float> out(distances.size());
  std::transform(distances.begin(), distances.end(), out.begin(),
                 [](double distance) { return static_cast<float>(distance < 0.0 ? kUndefined : distance); });
  return out;
}

}  // namespace lodlab::instrument
