// SPDX-License-Identifier: MIT
// The drawn surface of a height field, known at the source's samples: captured surface triangles (fillers
// left out) rasterized on the CPU, in double, edges inclusive. Where several triangles cover a sample the
// worst deviation counts. Threads meet in an atomic maximum, so the result is the same for any number.
//
// Drawn vertices are floats relative to the eye. A vertex that lies within world_slack() of a sample's
// horizontal position (planets: direction) is taken to be at it: then shared edges are exact, and rounding
// on a steep slope is not mistaken for error. Other triangles cover what lies within the slack of them. On a
// planet, where columns may fall together, they cover that for sure that lies farther inside than the slack,
// at any height that they have within it of a sample; of those that cover a sample perhaps the best counts.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/height_field.h"
#include "instrument/sample_grid.h"
#include "render/frame.h"

namespace lodlab::instrument {

class DrawnSurface {
 public:
  /// Rasterizes. A vertex that is not finite throws InvalidInput naming its node. Triangles without
  /// horizontal area cover nothing (of a planet, without solid angle, what no other does). With
  /// `worst_of_triangle` the largest deviation among each triangle's non-void samples is stored there, by
  /// triangle (-1: it covers none).
  DrawnSurface(const HeightField& field, const SampleGrid& grid, const render::Captured& captured,
               std::vector<float>* worst_of_triangle = nullptr);

  bool covered(int64_t sample) const { return keys_[static_cast<size_t>(sample)] != 0; }
  /// Drawn minus source height, source units; NaN where nothing covers the sample.
  float deviation(int64_t sample) const { return decode(keys_[static_cast<size_t>(sample)]); }

 private:
  /// Orders deviations by size, then positive before negative; 0 is left for "not covered".
  static uint32_t encode(float deviation) {
    const uint32_t size = std::bit_cast<uint32_t>(std::abs(deviation)) << 1;
    return size | (deviation >= 0.0f ? 1u : 0u);
  }
  static float decode(uint32_t key) {
    if (key == 0) return std::numeric_limits<float>::quiet_NaN();
    const float size = std::bit_cast<float>(key >> 1);
    return (key & 1u) != 0 ? size : -size;
  }
  friend class SurfaceWriter;
  std::vector<uint32_t> keys_;
};

}  // namespace lodlab::instrument
