// SPDX-License-Identifier: MIT
// Captured triangles over the samples of a flat field (geometry/scan_triangle.h).
#include <cmath>

#include "instrument/slack.h"
#include "instrument/surface_writer.h"

namespace lodlab::instrument {

FlatRasterizer::FlatRasterizer(const SampleGrid& grid, const glm::dvec3& eye)
    : frame_(grid.frame()),
      eye_(eye),
      rows_(grid.frame().rows),
      cols_(grid.frame().cols),
      origin_((eye.x - grid.frame().x0) / grid.frame().dx, (grid.frame().y0 - eye.y) / grid.frame().dy,
              eye.z),
      cells_x_(1.0 / grid.frame().dx),
      cells_y_(1.0 / grid.frame().dy) {}

GridCorner FlatRasterizer::corner(const render::CapturedVertex& v) const {
  GridCorner out;
  out.col = origin_.x + static_cast<double>(v.x) * cells_x_;
  out.row = origin_.y - static_cast<double>(v.y) * cells_y_;
  out.z = origin_.z + static_cast<double>(v.z);
  const glm::dvec2 slack = grid_slack(frame_, {v.x, v.y, v.z}, eye_) * glm::dvec2(cells_x_, cells_y_);
  const double col = std::nearbyint(out.col), row = std::nearbyint(out.row);
  if (std::abs(out.col - col) <= slack.x && std::abs(out.row - row) <= slack.y) {
    out.col = col;
    out.row = row;
    out.slack = 0.0;
  } else {
    out.slack = std::max(slack.x, slack.y);
  }
  return out;
}

void FlatRasterizer::draw(TriangleVertices vertices, SurfaceWriter& out) const {
  const GridCorner corners[3] = {corner(vertices[0]), corner(vertices[1]), corner(vertices[2])};
  scan_triangle(corners, rows_, cols_, [&](int64_t row, int64_t col, const double* heights, int count) {
    out.put_row(row, col, heights, count);
  });
}

}  // namespace lodlab::instrument
