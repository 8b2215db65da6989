// SPDX-License-Identifier: MIT
#include "methods/multigrain/grids.h"

#include <algorithm>

namespace lodlab::multigrain {

/// Counter-clockwise seen from above; beside a pole only the triangle of a cell that has an area.
Grids::Range Grids::range(const Shape& shape) {
  const auto known = ranges_.find(shape);
  if (known != ranges_.end()) return known->second;
  const auto first = static_cast<uint32_t>(indices_.size());
  for (int64_t left = 0; left < shape.cells_x; left += kStrip) {
    const int64_t strip = left / kStrip * shape.tile_rows * kStripPitch;
    const int64_t right = std::min(shape.cells_x, left + kStrip);
    for (int64_t j = 0; j < shape.cells_y; ++j) {
      const bool north = !(shape.pole_first && j == 0);
      const bool south = !(shape.pole_last && j + 1 == shape.cells_y);
      for (int64_t i = left; i < right; ++i) {
        const auto nw = static_cast<uint32_t>(strip + j * kStripPitch + (i - left));
        const auto ne = nw + 1, sw = nw + static_cast<uint32_t>(kStripPitch), se = sw + 1;
        const bool even = (i + j) % 2 == 0;
        if (south) indices_.insert(indices_.end(), {even ? nw : ne, sw, se});
        if (north) indices_.insert(indices_.end(), {nw, even ? se : sw, ne});
      }
    }
  }
  return ranges_[shape] = {first, static_cast<uint32_t>(indices_.size()) - first};
}

/// Between each cell's border, a great circle, and the samples of the row: a fan from its western corner.
Grids::Range Grids::fringe(int64_t width, int stride_log2, bool north) {
  const std::tuple key(width, stride_log2, north);
  const auto known = fringes_.find(key);
  if (known != fringes_.end()) return known->second;
  const auto first = static_cast<uint32_t>(indices_.size());
  const auto end = static_cast<uint32_t>(width), stride = uint32_t{1} << stride_log2;
  for (uint32_t west = 0; west < end; west += stride) {
    for (uint32_t i = west + 1; i < std::min(west + stride, end); ++i)
      indices_.insert(indices_.end(), {west, north ? i + 1 : i, north ? i : i + 1});
  }
  return fringes_[key] = {first, static_cast<uint32_t>(indices_.size()) - first};
}

}  // namespace lodlab::multigrain
