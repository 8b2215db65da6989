// SPDX-License-Identifier: MIT
// Normals of a height field at its samples, for shading that knows nothing of the triangles drawn: from
// central differences, one-sided at a border, over filled heights where samples are void. Flat: x east, y
// north, z up. On a planet in the planet's frame: X = (R + h) u has the normal u - h_lon / ((R + h) cos(lat))
// east
// - h_lat / (R + h) north, u the direction; a pole's is that of the plane that fits the row beside it best.
//
// A texel has a channel of 8 bits for each component, 127 being 0 (level ground stays level), and alpha 255:
// a component is off by at most 1/254, a normal by at most 0.39 degrees, 0.18 in the mean square.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/height_rows.h"

namespace lodlab {

class Normals {
 public:
  explicit Normals(const FieldFrame& frame);

  /// Rows that the normals of rows [first, end) need: from `first` to `end`, both excluded, less what is past
  /// the field.
  int64_t first_needed(int64_t first) const { return std::max<int64_t>(first - 1, 0); }
  int64_t end_needed(int64_t end) const { return std::min(end + 1, frame_.rows); }

  /// Unit normals of a row's samples; `rows` holds those that are needed.
  std::vector<glm::dvec3> row(const HeightRows& rows, int64_t row) const;

  /// As texels, and back (not of unit length).
  static uint32_t texel(const glm::dvec3& normal);
  static glm::dvec3 normal(uint32_t texel);

 private:
  glm::dvec3 pole(const HeightRows& rows, int64_t row) const;
  /// Height per column, and per row towards north.
  glm::dvec2 slope(const HeightRows& rows, int64_t row, int64_t col) const;

  FieldFrame frame_;
  std::vector<glm::dvec2> lon_;  ///< cosine and sine of a planet's columns
};

/// Texels of rows [first, end), on all threads.
std::vector<uint32_t> normal_texels(const Normals& normals, const HeightRows& rows, int64_t first,
                                    int64_t end);

}  // namespace lodlab
