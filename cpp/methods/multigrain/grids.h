// SPDX-License-Identifier: MIT
// Grids of triangles that nodes share: vertices (i, j) and indices, made on demand for each shape that a cut
// draws. A shape is as many cells as are there (grids are clamped at the border), without the triangles that a
// pole makes a line. Cell (i, j) is cut from (i, j) to (i + 1, j + 1) when i + j is even, else the other way.
// Triangles run down strips of columns, vertices are numbered in the order of first use (full/METHOD.md).
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <vector>

namespace lodlab::multigrain {

struct Shape {
  int64_t cells_x, cells_y;
  bool pole_first = false, pole_last = false;  ///< its first, its last row of vertices is one point
  auto operator<=>(const Shape&) const = default;
};

class Grids {
 public:
  struct Range {
    uint32_t first_index, indices;
    int32_t base_vertex;
    int32_t vertices;
  };
  struct Vertex {
    uint16_t i, j;
  };

  Range range(const Shape& shape);
  /// All shapes one after the other; both only grow.
  const std::vector<Vertex>& vertices() const { return vertices_; }
  const std::vector<uint32_t>& indices() const { return indices_; }

 private:
  void add_vertices(const Shape& shape);
  void add_indices(const Shape& shape);

  std::map<Shape, Range> ranges_;
  std::vector<Vertex> vertices_;
  std::vector<uint32_t> indices_;
};

}  // namespace lodlab::multigrain
