// SPDX-License-Identifier: MIT
// Where the samples of a height field lie, seen from an eye: positions and local up of samples, and the
// way back from a position relative to the eye to fractional grid coordinates. Double throughout; a planet's
// sines and cosines are tabled. A pole row is one place: its column 0 speaks for all columns.
#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "geometry/height_field.h"

namespace lodlab::instrument {

class SampleGrid {
 public:
  explicit SampleGrid(const FieldFrame& frame);

  const FieldFrame& frame() const { return frame_; }
  int64_t size() const { return frame_.rows * frame_.cols; }

  /// Local up: the direction along which heights are measured. On a planet the direction from its centre.
  glm::dvec3 up(int64_t row, int64_t col) const {
    if (!frame_.planet) return {0.0, 0.0, 1.0};
    const glm::dvec2 lat = latitude_[row], lon = longitude_[col];
    return {lat.x * lon.x, lat.x * lon.y, lat.y};
  }
  /// A point above (row, col) relative to the eye.
  glm::dvec3 relative(int64_t row, int64_t col, double height, const glm::dvec3& eye) const {
    if (frame_.planet) return (frame_.radius + height) * up(row, col) - eye;
    return {(frame_.x0 - eye.x) + static_cast<double>(col) * frame_.dx,
            (frame_.y0 - eye.y) - static_cast<double>(row) * frame_.dy, height - eye.z};
  }
  bool is_pole(int64_t row) const { return frame_.planet && latitude_[row].x == 0.0; }
  /// The source's height at a sample.
  double height(const HeightField& field, int64_t row, int64_t col) const {
    return field.at(row, is_pole(row) ? 0 : col);
  }

  /// Fractional (column, row) of a position relative to the eye. Columns of a planet that wraps lie in
  /// [0, cols); of others within half a turn of the field's middle.
  glm::dvec2 coordinates(const glm::dvec3& relative, const glm::dvec3& eye) const;

  /// Bits of the borders of the source on which a drawn position lies, within its slack (slack.h):
  /// 1 first row, 2 last row, 4 first column, 8 last column. A wrapping planet has no columns at its
  /// border, and a pole is none.
  int borders(const glm::dvec3& relative, const glm::dvec3& eye) const;

  /// Whether floats may not part the columns of a planet at a drawn position: they lie within its slack of
  /// one another.
  bool columns_fall_together(const glm::dvec3& relative, const glm::dvec3& eye) const;

 private:
  FieldFrame frame_;
  std::vector<glm::dvec2> latitude_, longitude_;  ///< cosine, sine
};

}  // namespace lodlab::instrument
