// SPDX-License-Identifier: MIT
// Axis-aligned boxes in space, and distances from a point to them.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>
#include <limits>

namespace lodlab {

struct Box {
  glm::dvec3 lo{std::numeric_limits<double>::infinity()};
  glm::dvec3 hi{-std::numeric_limits<double>::infinity()};

  void add(const glm::dvec3& point) {
    lo = glm::min(lo, point);
    hi = glm::max(hi, point);
  }
  void add(const Box& other) {
    lo = glm::min(lo, other.lo);
    hi = glm::max(hi, other.hi);
  }
  bool empty() const { return !(lo.x <= hi.x); }
  glm::dvec3 center() const { return 0.5 * (lo + hi); }
};

/// Vector from the point to the nearest point of the box, per axis and not negative; 0 inside.
inline glm::dvec3 gap(const Box& box, const glm::dvec3& point) {
  return glm::max(glm::max(box.lo - point, point - box.hi), glm::dvec3(0.0));
}

/// Distance from the point to the nearest point of the box; 0 inside.
inline double distance(const Box& box, const glm::dvec3& point) { return glm::length(gap(box, point)); }

/// Distance from the point to the farthest corner of the box.
inline double reach(const Box& box, const glm::dvec3& point) {
  return glm::length(glm::max(glm::abs(box.lo - point), glm::abs(box.hi - point)));
}

}  // namespace lodlab
