// SPDX-License-Identifier: MIT
// The only slack that any law of the instrument is allowed, from how positions are rounded
// (shaders/common/position.glsl): on a flat field whole cells less the eye's part of a cell, times the
// spacing; three roundings of half a step each (2^-24), of the spacing, the product and the difference of
// heights, and one of the eye's part, half a step of a cell. On a planet a double, cast to float, of a place
// that may be kept on a lattice (FieldFrame::position_step()), which is half its diagonal off.
// Four float steps hold both, and 1e-15 of the lengths that doubles were made of. In pixels a hundredth.
// crack_edges compares bit for bit, but for what lies on the border.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

#include "geometry/height_field.h"

namespace lodlab::instrument {

inline constexpr double kSlackSteps = 4.0;
inline constexpr double kSlackPixels = 0.01;

/// The step between neighbouring floats of this size (2^(e - 23) for 2^e <= |distance|); 0 at 0.
inline double float_step(double distance) {
  const uint32_t exponent = std::bit_cast<uint32_t>(static_cast<float>(distance)) & 0x7f800000u;
  return static_cast<double>(std::bit_cast<float>(exponent)) * 0x1p-23;
}

/// How far, in source units, a drawn vertex at this distance from the eye may be from where it belongs.
inline double world_slack(double distance) { return kSlackSteps * float_step(distance); }

inline constexpr double kDoubleSlack = 1e-15;  ///< of the lengths that doubles on the way were made of

/// The same for a vertex of a field, `relative` to the eye, the doubles that lead to it counted.
inline double vertex_slack(const FieldFrame& frame, const glm::dvec3& relative, const glm::dvec3& eye) {
  const double distance = glm::length(relative);
  if (frame.planet)
    return world_slack(distance) + frame.position_step() + kDoubleSlack * (2.0 * glm::length(eye) + distance);
  const double made_of = glm::length(eye - glm::dvec3(frame.x0, frame.y0, 0.0)) + distance;
  return world_slack(std::max({distance, frame.dx, frame.dy})) + kDoubleSlack * made_of;
}

/// Of a flat field along its columns and rows: each coordinate is rounded by its own size, and by a cell's,
/// as the eye's part of a cell is rounded however near it is.
inline glm::dvec2 grid_slack(const FieldFrame& frame, const glm::dvec3& relative, const glm::dvec3& eye) {
  const auto along = [](double offset, double cell, double made_of) {
    return world_slack(std::max(std::abs(offset), cell)) +
           kDoubleSlack * (std::abs(made_of) + std::abs(offset));
  };
  return {along(relative.x, frame.dx, eye.x - frame.x0), along(relative.y, frame.dy, eye.y - frame.y0)};
}

}  // namespace lodlab::instrument
