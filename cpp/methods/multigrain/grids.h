// SPDX-License-Identifier: MIT
// Grids of triangles that nodes share: indices, made on demand for each shape that a cut draws. A shape is as
// many cells as are there (grids are clamped at the border), without the triangles that a pole makes a line.
// Cell (i, j) is cut from (i, j) to (i + 1, j + 1) when i + j is even, else the other way.
//
// The vertices of a grid are heights of a tile as it lies on the GPU: in strips of 16 cells, 17 heights a
// row, one strip after the other. Triangles run down the strips, so that the row above is still in the vertex
// cache (full/METHOD.md); a strip's last column is the next one's first again, which costs no vertex that the
// cache kept.
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <tuple>
#include <vector>

namespace lodlab::multigrain {

inline constexpr int64_t kStrip = 16;               // cells across a strip; grid.vert knows it too
inline constexpr int64_t kStripPitch = kStrip + 1;  // heights

/// Strips of a tile so many heights wide.
inline int64_t strips(int64_t cols) { return (cols - 1 + kStrip - 1) / kStrip; }

struct Shape {
  int64_t cells_x, cells_y;
  int64_t tile_rows;                           ///< from one strip to the next
  bool pole_first = false, pole_last = false;  ///< its first, its last row of vertices is one point
  auto operator<=>(const Shape&) const = default;
};

class Grids {
 public:
  struct Range {
    uint32_t first_index, indices;
  };

  /// Indices count from the height of the grid's vertex (0, 0).
  Range range(const Shape& shape);
  /// A fringe along so many samples, drawn with a stride: indices count from the sample under the grid's
  /// vertex (0, 0), in the row itself.
  Range fringe(int64_t width, int stride_log2, bool north);
  /// All shapes one after the other; only grows.
  const std::vector<uint32_t>& indices() const { return indices_; }

 private:
  std::map<Shape, Range> ranges_;
  std::map<std::tuple<int64_t, int, bool>, Range> fringes_;
  std::vector<uint32_t> indices_;
};

}  // namespace lodlab::multigrain
