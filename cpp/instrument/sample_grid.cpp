// SPDX-License-Identifier: MIT
#include "instrument/sample_grid.h"

#include <cmath>

#include "geometry/angles.h"
#include "instrument/slack.h"

namespace lodlab::instrument {
SampleGrid::SampleGrid(const FieldFrame& frame) : frame_(frame) {
  if (!frame_.planet) return;
  for (int64_t row = 0; row < frame_.rows; ++row) {
    latitude_.push_back(cos_sin_degrees(frame_.latitude(row)) + 0.0);
  }
  for (int64_t col = 0; col < frame_.cols; ++col) {
    longitude_.push_back(cos_sin_degrees(frame_.longitude(col)) + 0.0);
  }
}

glm::dvec2 SampleGrid::coordinates(const glm::dvec3& relative, const glm::dvec3& eye) const {
  if (!frame_.planet) {
    return {((eye.x - frame_.x0) + relative.x) / frame_.dx, ((frame_.y0 - eye.y) - relative.y) / frame_.dy};
  }
  const glm::dvec3 p = eye + relative;
  const double lon = std::atan2(p.y, p.x) * kDegreesPerRadian;
  const double lat = std::atan2(p.z, std::hypot(p.x, p.y)) * kDegreesPerRadian;
  const double row = (frame_.lat0 - lat) / frame_.dlat;
  if (frame_.wraps) {
    const double period = static_cast<double>(frame_.cols);
    double col = std::fmod((lon - frame_.lon0) / frame_.dlon, period);
    if (col < 0.0) col += period;
    return {col < period ? col : 0.0, row};
  }
  const double middle = 0.5 * static_cast<double>(frame_.cols - 1);
  const double from_middle = std::remainder(lon - (frame_.lon0 + middle * frame_.dlon), 360.0);
  return {middle + from_middle / frame_.dlon, row};
}

int SampleGrid::borders(const glm::dvec3& relative, const glm::dvec3& eye) const {
  const glm::dvec2 at = coordinates(relative, eye);
  glm::dvec2 step(frame_.dx, frame_.dy), slack(vertex_slack(frame_, relative, eye));
  if (frame_.planet) {
    const glm::dvec3 p = eye + relative;
    step = glm::dvec2(std::hypot(p.x, p.y) * frame_.dlon, glm::length(p) * frame_.dlat) / kDegreesPerRadian;
  } else {
    slack = grid_slack(frame_, relative, eye);
  }
  const auto on = [&](int axis, int64_t line) {
    double away = at[axis] - static_cast<double>(line);
    if (frame_.planet && axis == 0) away = std::remainder(away, 360.0 / frame_.dlon);  // beside a pole
    return std::abs(away) * step[axis] <= slack[axis];
  };
  int bits = 0;
  if (on(1, 0) && !is_pole(0)) bits |= 1;
  if (on(1, frame_.rows - 1) && !is_pole(frame_.rows - 1)) bits |= 2;
  if (frame_.wraps) return bits;
  if (on(0, 0)) bits |= 4;
  if (on(0, frame_.cols - 1)) bits |= 8;
  return bits;
}

bool SampleGrid::columns_fall_together(const glm::dvec3& relative, const glm::dvec3& eye) const {
  const glm::dvec3 p = eye + relative;
  return frame_.planet &&
         std::hypot(p.x, p.y) * frame_.dlon * kRadiansPerDegree < vertex_slack(frame_, relative, eye);
}

}  // namespace lodlab::instrument
