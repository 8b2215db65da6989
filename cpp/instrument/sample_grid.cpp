// SPDX-License-Identifier: MIT
#include "instrument/sample_grid.h"

#include <cmath>

#include "geometry/angles.h"

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

int SampleGrid::borders(const glm::dvec3& relative, const glm::dvec3& eye, double tolerance) const {
  const glm::dvec2 at = coordinates(relative, eye);
  double col_step = frame_.dx, row_step = frame_.dy;
  if (frame_.planet) {
    const glm::dvec3 p = eye + relative;
    row_step = glm::length(p) * frame_.dlat / kDegreesPerRadian;
    col_step = std::hypot(p.x, p.y) * frame_.dlon / kDegreesPerRadian;
  }
  const auto on = [&](double value, int64_t line, double step) {
    return std::abs(value - static_cast<double>(line)) * step <= tolerance;
  };
  int bits = 0;
  if (on(at.y, 0, row_step) && !is_pole(0)) bits |= 1;
  if (on(at.y, frame_.rows - 1, row_step) && !is_pole(frame_.rows - 1)) bits |= 2;
  if (frame_.wraps) return bits;
  if (on(at.x, 0, col_step)) bits |= 4;
  if (on(at.x, frame_.cols - 1, col_step)) bits |= 8;
  return bits;
}

}  // namespace lodlab::instrument
