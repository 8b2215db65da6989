// SPDX-License-Identifier: MIT
// Height fields and captured triangles made by hand, for tests of the instrument that need no GL.
#pragma once

#include <cmath>
#include <functional>
#include <memory>
#include <vector>

#include "geometry/height_field.h"
#include "render/frame.h"

namespace synthetic {

using Height = std::function<double(int64_t row, int64_t col)>;

inline std::shared_ptr<const lodlab::HeightField> field(lodlab::FieldFrame frame, const Height& height,
                                                        std::vector<uint8_t> valid = {}) {
  struct Arrays {
    std::vector<float> heights;
    std::vector<uint8_t> valid;
  };
  auto arrays = std::make_shared<Arrays>();
  arrays->valid = std::move(valid);
  for (int64_t row = 0; row < frame.rows; ++row) {
    for (int64_t col = 0; col < frame.cols; ++col)
      arrays->heights.push_back(static_cast<float>(height(row, col)));
  }
  const uint8_t* mask = arrays->valid.empty() ? nullptr : arrays->valid.data();
  return lodlab::make_height_field(frame, arrays->heights.data(), mask, arrays, "");
}

inline lodlab::FieldFrame flat(int64_t rows, int64_t cols, double spacing = 1.0, double x0 = 0.0,
                               double y0 = 0.0) {
  lodlab::FieldFrame frame;
  frame.rows = rows;
  frame.cols = cols;
  frame.dx = frame.dy = spacing;
  frame.x0 = x0;
  frame.y0 = y0;
  return frame;
}

/// A whole planet whose rows run from pole to pole.
inline lodlab::FieldFrame planet(int64_t rows, int64_t cols, double radius = 1000.0) {
  lodlab::FieldFrame frame;
  frame.rows = rows;
  frame.cols = cols;
  frame.planet = true;
  frame.radius = radius;
  frame.lat0 = 90.0;
  frame.dlat = 180.0 / static_cast<double>(rows - 1);
  frame.dlon = 360.0 / static_cast<double>(cols);
  frame.wraps = true;
  return frame;
}

/// A vertex as a GPU would emit it: the world position minus the eye, cast to float once.
inline lodlab::render::CapturedVertex vertex(const glm::dvec3& world, const glm::dvec3& eye,
                                             uint32_t node = 0) {
  const glm::dvec3 p = world - eye;
  return {static_cast<float>(p.x), static_cast<float>(p.y), static_cast<float>(p.z), 0.0f, 0.0f, node, 0};
}

struct Corner {
  int64_t row, col;
};

inline void add(lodlab::render::Captured& out, const lodlab::FieldFrame& frame, const Height& height,
                Corner a, Corner b, Corner c, uint32_t node = 0) {
  for (const Corner& at : {a, b, c}) {
    out.vertices.push_back(vertex(frame.position(at.row, at.col, height(at.row, at.col)), out.eye, node));
  }
}

/// The 4-8 mesh with legs of `step` cells, every triangle counter-clockwise seen from above. On planets
/// that wrap, columns close; triangles that collapse at a pole are left out.
inline lodlab::render::Captured mesh(const lodlab::FieldFrame& frame, const glm::dvec3& eye,
                                     const Height& height, int64_t step = 1) {
  lodlab::render::Captured out;
  out.eye = eye;
  const int64_t cells = frame.wraps ? frame.cols : frame.cols - 1;
  const auto pole = [&](int64_t row) { return frame.planet && std::abs(frame.latitude(row)) == 90.0; };
  const auto triangle = [&](Corner a, Corner b, Corner c) {
    const int poles = pole(a.row) + pole(b.row) + pole(c.row);
    if (poles < 2) add(out, frame, height, a, b, c);
  };
  for (int64_t row = 0; row + 1 < frame.rows; row += step) {
    for (int64_t col = 0; col < cells; col += step) {
      const int64_t down = std::min(row + step, frame.rows - 1);
      const int64_t right = frame.wraps ? (col + step) % frame.cols : std::min(col + step, frame.cols - 1);
      const Corner nw{row, col}, ne{row, right}, sw{down, col}, se{down, right};
      if ((row / step + col / step) % 2 == 0) {
        triangle(nw, sw, se);
        triangle(nw, se, ne);
      } else {
        triangle(nw, sw, ne);
        triangle(ne, sw, se);
      }
    }
  }
  return out;
}

}  // namespace synthetic
