// SPDX-License-Identifier: MIT
// From pixels back to points, and what a set of distances on the screen comes to.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/view.h"
#include "instrument/sample_error.h"
#include "instrument/sample_grid.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// The point that a pixel's centre shows at this distance along the view axis, relative to the eye.
inline glm::dvec3 unproject(const Camera& camera, int x, int y, double depth) {
  const double right = (x + 0.5 - 0.5 * camera.width) / camera.K,
               up = (0.5 * camera.height - y - 0.5) / camera.K;
  return depth * (camera.forward + right * camera.right + up * camera.up);
}

/// A pixel without a surface, among distances.
inline constexpr double kNothing = -1.0;

/// Calls `distances(points, out)` for every row of pixels with the points that its covered ones show,
/// relative to the eye, for a distance at each. Row by row; kNothing where the picture is empty. InvalidInput
/// when it has no depth or not the camera's size.
template <class Distances>
std::vector<double> over_rows(const render::Picture& picture, const Camera& camera,
                              const Distances& distances) {
  const size_t width = static_cast<size_t>(camera.width), pixels = width * static_cast<size_t>(camera.height);
  if (picture.width != camera.width || picture.height != camera.height || picture.depth.size() != pixels) {
    throw InvalidInput("measure: the picture is " + std::to_string(picture.width) + " x " +
                       std::to_string(picture.height) + " with " + std::to_string(picture.depth.size()) +
                       " depths; the view is " + std::to_string(camera.width) + " x " +
                       std::to_string(camera.height));
  }
  std::vector<double> out(pixels, kNothing);
  parallel_for(camera.height, 8, [&](int64_t begin, int64_t end) {
    std::vector<glm::dvec3> points;
    std::vector<size_t> at;
    std::vector<double> found;
    for (int64_t y = begin; y < end; ++y) {
      points.clear();
      at.clear();
      for (int x = 0; x < camera.width; ++x) {
        const size_t pixel = static_cast<size_t>(y) * width + static_cast<size_t>(x);
        const double depth = picture.depth[pixel];
        if (!std::isfinite(depth)) continue;
        points.push_back(unproject(camera, x, static_cast<int>(y), depth));
        at.push_back(pixel);
      }
      found.resize(points.size());
      distances(std::span<const glm::dvec3>(points), std::span<double>(found));
      for (size_t i = 0; i < at.size(); ++i) out[at[i]] = found[i];
    }
  });
  return out;
}

/// Local up at a point relative to the eye.
inline glm::dvec3 up_at(const SampleGrid& grid, const glm::dvec3& relative, const glm::dvec3& eye) {
  return grid.frame().planet ? glm::normalize(eye + relative) : glm::dvec3(0.0, 0.0, 1.0);
}

struct PixelError {
  double p99 = kUndefined;  ///< the value that 99 % of the covered pixels do not exceed (nearest rank)
  double rms = kUndefined;
  double finite_max = kUndefined;  ///< the largest that is no hole; nan when there is none
  int64_t pixels = 0;              ///< covered pixels; nan above when there are none
};

/// The largest of distances that is finite; nan when none is.
template <class Distances>
double finite_max(const Distances& distances) {
  double out = kUndefined;
  for (const double distance : distances) {
    if (std::isfinite(distance)) out = std::fmax(out, distance);
  }
  return out;
}

/// Of the distances at all pixels, kNothing left out.
inline PixelError summarize(std::vector<double> distances) {
  std::erase_if(distances, [](double distance) { return distance < 0.0; });
  PixelError out;
  out.pixels = static_cast<int64_t>(distances.size());
  if (distances.empty()) return out;
  double squares = 0.0;
  for (const double distance : distances) squares += distance * distance;
  out.finite_max = finite_max(distances);
  out.rms = std::sqrt(squares / static_cast<double>(distances.size()));
  const auto rank = distances.begin() + static_cast<int64_t>((distances.size() * 99 + 99) / 100) - 1;
  std::nth_element(distances.begin(), rank, distances.end());
  out.p99 = *rank;
  return out;
}

}  // namespace lodlab::instrument
