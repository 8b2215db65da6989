// SPDX-License-Identifier: MIT
// Projected errors of nodes under one view (shaders/common/projection.h), by the option `projection`.
#pragma once

#include <algorithm>
#include <cmath>
#include <string>

#include "base/options.h"
#include "common/projection.h"
#include "geometry/bounds.h"
#include "geometry/height_field.h"
#include "geometry/view.h"

namespace lodlab {

enum class Projection { kPaper, kStrict, kVertical };

/// The draw option `projection`, and its value for a source. Unsupported: vertical on a planet, where up is
/// another direction at every sample.
OptionSpec projection_option();
Projection projection_of(const Options& options, const FieldFrame& source);

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
};

inline Projector::Place Projector::place(const double (&lo)[3], const double (&hi)[3]) const {
  double square[3];
  for (int i = 0; i < 3; ++i) {
    const double d = std::max({lo[i] - eye[i], eye[i] - hi[i], 0.0});
    square[i] = d * d;
  }
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
