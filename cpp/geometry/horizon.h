// SPDX-License-Identifier: MIT
// What a planet hides from an eye: all whose way to the eye passes through a sphere round the origin that
// lies inside of its ground, as long as that ground closes round it. From within the sphere nothing is
// hidden, nor by a sphere of radius 0, nor by a planet with an opening: a patch has an outside, a void is
// looked through.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>

#include "geometry/height_field.h"

namespace lodlab {

/// Whether the ground of a source closes round the origin: columns once round, samples at both poles, no
/// voids.
inline bool closes(const FieldFrame& source, bool has_voids) {
  return source.planet && source.wraps && !has_voids && source.latitude(0) == 90.0 &&
         source.latitude(source.rows - 1) == -90.0;
}

/// Directions from the origin, no farther than an angle from an axis.
struct Cone {
  glm::dvec3 axis;      ///< unit
  double cosine, sine;  ///< of the angle, 0 to pi
};

class Horizon {
 public:
  Horizon(double radius, const glm::dvec3& eye)
      : eye_(eye), distance_(glm::length(eye)), cosine_(std::min(radius / distance_, 1.0)) {
    hides_ = radius > 0.0 && distance_ > radius;
    sine_ = std::sqrt(1.0 - cosine_ * cosine_);
    tangent_ = (distance_ - radius) * (distance_ + radius);
  }

  /// A point outside of the sphere, relative to the eye.
  bool hides(const glm::dvec3& relative) const {
    if (!hides_) return false;
    const double along = -glm::dot(eye_, relative), square = glm::dot(relative, relative);
    return along > 0.0 && along < square && tangent_ * square < along * along;
  }

  /// Everything in the cone up to a height: its angle has acos(radius / height) added to it, since that much
  /// farther than the eye's own acos(radius / distance) a point is seen.
  bool hides(const Cone& raised) const {
    if (!hides_) return false;
    const double sum_sine = raised.sine * cosine_ + raised.cosine * sine_;
    const double sum_cosine = raised.cosine * cosine_ - raised.sine * sine_;
    return sum_sine > 0.0 && glm::dot(raised.axis, eye_) < sum_cosine * distance_;
  }

 private:
  glm::dvec3 eye_;
  double distance_, cosine_, sine_ = 0.0;  ///< of the angle to the sphere's visible rim
  double tangent_ = 0.0;                   ///< squared distance to the rim
  bool hides_ = false;
};

}  // namespace lodlab
