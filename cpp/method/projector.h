// SPDX-License-Identifier: MIT
// Projected errors of nodes under one view (shaders/common/projection.h), by the option `projection`.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "base/options.h"
#include "common/projection.h"
#include "geometry/bounds.h"
#include "geometry/view.h"

namespace lodlab {

enum class Projection { kPaper, kStrict, kVertical };

/// The draw option `projection`, and its value. Unsupported: vertical where z is not up, on planets and
/// meshes.
OptionSpec projection_option();
Projection projection_of(const Options& options, bool z_is_up);

/// Constants are computed once a frame.
struct Projector {
  Projection kind;
  double K, n, s;
  glm::dvec3 eye;

  Projector(Projection projection, const Camera& camera);
  struct Place {
    double distance, cosine;
  };
  /// Where the eye sees bounds from `lo` to `hi`.
  Place place(const double (&lo)[3], const double (&hi)[3]) const;
  double project(double delta, const Place& place) const;
  /// The largest delta that projects to at most tau pixels there.
  double inverse(double tau, const Place& place) const;
  /// A delta projects to less than tau pixels wherever it is seen from so many times as far away, or farther:
  /// a place is told without a root or a division. A hair more than exact, for what rounding takes.
  double safe_distance(double tau) const {
    return (kind == Projection::kPaper ? K / tau : s * (1.0 + K * s / tau)) * (1.0 + 1e-9);
  }
};

/// From the eye to the nearest point of bounds, squared, along each axis.
inline std::array<double, 3> axis_squares(const glm::dvec3& eye, const double (&lo)[3],
                                          const double (&hi)[3]) {
  std::array<double, 3> square;
  for (int i = 0; i < 3; ++i) {
    const double d = std::max({lo[i] - eye[i], eye[i] - hi[i], 0.0});
    square[static_cast<size_t>(i)] = d * d;
  }
  return square;
}

inline Projector::Place Projector::place(const double (&lo)[3], const double (&hi)[3]) const {
  const std::array<double, 3> square = axis_squares(eye, lo, hi);
  const double distance = std::sqrt(square[0] + square[1] + square[2]);
  if (kind != Projection::kVertical) return {distance, 1.0};
  const double far_x = std::max(eye.x - lo[0], hi[0] - eye.x);
  const double far_y = std::max(eye.y - lo[1], hi[1] - eye.y);
  return {distance, elevation_cosine(std::sqrt(far_x * far_x + far_y * far_y), std::sqrt(square[2]))};
}

inline double Projector::project(double delta, const Place& at) const {
  if (kind == Projection::kPaper) return project_paper(delta, K, at.distance, n);
  return project_strict(delta, K, at.distance, n, s, at.cosine);
}

inline double Projector::inverse(double tau, const Place& at) const {
  if (kind == Projection::kPaper) return inverse_paper(tau, K, at.distance, n);
  return inverse_strict(tau, K, at.distance, n, s, at.cosine);
}

}  // namespace lodlab
