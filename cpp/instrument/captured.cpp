// SPDX-License-Identifier: MIT
#include "instrument/captured.h"

#include <algorithm>
#include <cstdio>

#include "base/parallel.h"
#include "geometry/mesh.h"
#include "render/camera_block.h"

namespace lodlab::instrument {
namespace {

bool within(const glm::dvec3& p) {  // not true of NaN
  return std::abs(p.x) <= kFarthestVertex && std::abs(p.y) <= kFarthestVertex &&
         std::abs(p.z) <= kFarthestVertex;
}

void check_positions(std::span<const Triangle> triangles) {
  for (size_t i = 0; i < triangles.size(); ++i) {
    for (const glm::dvec3& p : triangles[i]) {
      if (within(p)) continue;
      char text[200];
      std::snprintf(text, sizeof text,
                    "measure: triangle %zu has a vertex at (%.9g, %.9g, %.9g); positions must be finite, and "
                    "within %g",
                    i, p.x, p.y, p.z, kFarthestVertex);
      throw InvalidInput(text);
    }
  }
}

}  // namespace

render::Captured captured_from(std::span<const Triangle> triangles, std::span<const uint8_t> fillers,
                               const glm::dvec3& eye) {
  if (triangles.empty()) throw InvalidInput("measure: no triangles");
  check_positions(triangles);
  render::Captured out;
  out.eye = eye;
  out.vertices.reserve(3 * triangles.size());
  out.given.reserve(3 * triangles.size());
  for (size_t i = 0; i < triangles.size(); ++i) {
    const uint32_t bits = !fillers.empty() && fillers[i] != 0 ? 1u : 0u;
    for (const glm::dvec3& p : triangles[i]) {
      const glm::vec3 at(p - eye);
      out.vertices.push_back({at.x, at.y, at.z, 0.0f, 0.0f, 0, bits});
      out.given.push_back(p);
    }
  }
  return out;
}

void place_on_grid(render::Captured& captured, const SampleGrid& grid, const Camera& camera) {
  const FieldFrame& frame = grid.frame();
  const render::CameraBlock block = render::make_camera_block(camera, frame);
  const double turn = 360.0 / frame.dlon;  // columns once round a planet
  parallel_for(captured.triangles(), 16384, [&](int64_t begin, int64_t end) {
    for (int64_t t = begin; t < end; ++t) {
      double first = 0.0;
      for (int64_t i = 3 * t; i < 3 * t + 3; ++i) {
        render::CapturedVertex& v = captured.vertices[static_cast<size_t>(i)];
        glm::dvec2 place = grid.coordinates({v.x, v.y, v.z}, captured.eye);
        if (i == 3 * t) first = place.x;
        if (frame.planet) place.x = first + std::remainder(place.x - first, turn);  // of one turn
        v.col = static_cast<float>(place.x - block.eye_cell[0]);
        v.row = static_cast<float>(place.y - block.eye_cell[1]);
      }
    }
  });
}

}  // namespace lodlab::instrument
