// SPDX-License-Identifier: MIT
// Projected errors of nodes under one view (shaders/common/projection.h), by the option `projection`.
#pragma once

#include <string>

#include "base/options.h"
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

}  // namespace lodlab
