// SPDX-License-Identifier: MIT
// Captured triangles drawn from plain buffers with the shared shading. Positions, grid coordinates and bits
// lie in buffers of their own, so that a variant fetches only what it shades with: where nothing is void and
// no levels are shown, a vertex is 12 bytes.
#pragma once

#include "gl/buffer.h"
#include "gl/vertex_array.h"
#include "render/frame.h"

namespace lodlab::render {

class StaticMesh {
 public:
  /// Every three vertices a triangle, each with the values that stand there.
  explicit StaticMesh(const std::vector<CapturedVertex>& vertices);
  /// Vertex i is captured vertex first_use[i]; three indices a triangle.
  StaticMesh(const std::vector<CapturedVertex>& vertices, const std::vector<uint32_t>& indices,
             const std::vector<uint32_t>& first_use);

  void draw(Pass& pass, const Surface& field);

 private:
  template <class Order>
  void fill(const std::vector<CapturedVertex>& vertices, size_t count, const Order& order);

  void put_indices(const std::vector<uint32_t>& indices);

  gl::Buffer positions_, grids_, tags_, indices_;
  gl::VertexArray array_;
  int64_t vertices_ = 0, corners_ = 0;
};

}  // namespace lodlab::render
