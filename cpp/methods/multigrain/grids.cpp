// SPDX-License-Identifier: MIT
#include "methods/multigrain/grids.h"

#include <algorithm>

namespace lodlab::multigrain {
namespace {

constexpr int64_t kStrip = 16;  // cells across a strip

/// A vertex's number in its shape. The first strip owns its left edge.
uint32_t number(const Shape& shape, int64_t i, int64_t j) {
  const int64_t strip = i == 0 ? 0 : (i - 1) / kStrip;
  const int64_t first = strip == 0 ? 0 : strip * kStrip + 1;
  const int64_t width = std::min(shape.cells_x, (strip + 1) * kStrip) + 1 - first;
  return static_cast<uint32_t>((shape.cells_y + 1) * first + j * width + (i - first));
}

}  // namespace

Grids::Range Grids::range(const Shape& shape) {
  const auto known = ranges_.find(shape);
  if (known != ranges_.end()) return known->second;
  Range range;
  range.first_index = static_cast<uint32_t>(indices_.size());
  range.base_vertex = static_cast<int32_t>(vertices_.size());
  add_vertices(shape);
  add_indices(shape);
  range.indices = static_cast<uint32_t>(indices_.size()) - range.first_index;
  range.vertices = static_cast<int32_t>(vertices_.size()) - range.base_vertex;
  return ranges_[shape] = range;
}

void Grids::add_vertices(const Shape& shape) {
  const size_t base = vertices_.size();
  vertices_.resize(base + static_cast<size_t>((shape.cells_x + 1) * (shape.cells_y + 1)));
  for (int64_t j = 0; j <= shape.cells_y; ++j) {
    for (int64_t i = 0; i <= shape.cells_x; ++i) {
      vertices_[base + number(shape, i, j)] = {static_cast<uint16_t>(i), static_cast<uint16_t>(j)};
    }
  }
}

/// Counter-clockwise seen from above; beside a pole only the triangle of a cell that has an area.
void Grids::add_indices(const Shape& shape) {
  const auto add_cell = [&](int64_t i, int64_t j) {
    const uint32_t nw = number(shape, i, j), ne = number(shape, i + 1, j);
    const uint32_t sw = number(shape, i, j + 1), se = number(shape, i + 1, j + 1);
    const bool even = (i + j) % 2 == 0;
    const bool north = !(shape.pole_first && j == 0), south = !(shape.pole_last && j + 1 == shape.cells_y);
    if (south) indices_.insert(indices_.end(), {even ? nw : ne, sw, se});
    if (north) indices_.insert(indices_.end(), {nw, even ? se : sw, ne});
  };
  for (int64_t left = 0; left < shape.cells_x; left += kStrip) {
    const int64_t right = std::min(shape.cells_x, left + kStrip);
    for (int64_t j = 0; j < shape.cells_y; ++j) {
      for (int64_t i = left; i < right; ++i) add_cell(i, j);
    }
  }
}

}  // namespace lodlab::multigrain
