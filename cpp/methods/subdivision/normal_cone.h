// SPDX-License-Identifier: MIT
// Cones that hold unit normals: an axis, and an angle from it that none exceeds.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>

namespace lodlab::subdivision {

struct NormalCone {
  glm::dvec3 axis{0.0};
  double angle = -1.0;  ///< of no normals: below 0
};

/// More than the rounding of merging, which would else add up.
inline constexpr double kConeRounding = 1e-12;

inline double angle_between(const glm::dvec3& a, const glm::dvec3& b) {
  return std::atan2(glm::length(glm::cross(a, b)), glm::dot(a, b));
}

/// The least cone round two cones; not the least round what they hold.
inline NormalCone merged(const NormalCone& a, const NormalCone& b) {
  if (a.angle < 0.0) return b;
  if (b.angle < 0.0) return a;
  const double between = angle_between(a.axis, b.axis);
  if (between + b.angle <= a.angle) return a;
  if (between + a.angle <= b.angle) return b;
  const double angle = 0.5 * (a.angle + between + b.angle) + kConeRounding;
  const double turned = angle - a.angle, sine = std::sin(between);
  if (sine < 1e-9) return {a.axis, std::max(a.angle, between + b.angle) + kConeRounding};
  const glm::dvec3 axis = (std::sin(between - turned) * a.axis + std::sin(turned) * b.axis) / sine;
  return {glm::normalize(axis), angle};
}

}  // namespace lodlab::subdivision
