// SPDX-License-Identifier: MIT
#include "instrument/orientation.h"

#include <algorithm>
#include <atomic>

#include "base/parallel.h"
#include "instrument/captured.h"
#include "instrument/pixels.h"
#include "instrument/slack.h"

namespace lodlab::instrument {
namespace {

/// Twice the area that a triangle covers seen along local up, positive when counter-clockwise from outside;
/// 0 when no more of it is there than rounded corners make.
double covered_area(const SampleGrid& grid, const render::CapturedVertex* v, const glm::dvec3& eye) {
  const glm::dvec3 a(v[0].x, v[0].y, v[0].z), b(v[1].x, v[1].y, v[1].z), c(v[2].x, v[2].y, v[2].z);
  const glm::dvec3 ab = b - a, ac = c - a, bc = c - b;
  const double area = glm::dot(glm::cross(ab, ac), up_at(grid, (a + b + c) / 3.0, eye));
  const FieldFrame& frame = grid.frame();
  const double slack =
      std::max({vertex_slack(frame, a, eye), vertex_slack(frame, b, eye), vertex_slack(frame, c, eye)});
  const double rounding = slack * (glm::length(ab) + glm::length(ac) + glm::length(bc));
  return std::abs(area) > rounding ? area : 0.0;
}

}  // namespace

Orientation orientation(const SampleGrid& grid, const render::Captured& captured) {
  std::atomic<int64_t> inverted = 0, slanted = 0;
  parallel_for(captured.triangles(), 16384, [&](int64_t begin, int64_t end) {
    int64_t inverted_here = 0, slanted_here = 0;
    for (int64_t t = begin; t < end; ++t) {
      const render::CapturedVertex* v = &captured.vertices[static_cast<size_t>(3 * t)];
      const double area = covered_area(grid, v, captured.eye);
      const bool filler = is_filler(v);
      inverted_here += !filler && area < 0.0 ? 1 : 0;
      slanted_here += filler && area != 0.0 ? 1 : 0;
    }
    inverted += inverted_here;
    slanted += slanted_here;
  });
  return {inverted, slanted};
}

Orientation orientation(const MeshSurface& source, const glm::dvec3& centre, const render::Captured& captured,
                        const NodeBound& bound) {
  const glm::dvec3 offset = captured.eye - centre;
  std::atomic<int64_t> inverted = 0;
  parallel_for(captured.triangles(), 1024, [&](int64_t begin, int64_t end) {
    int64_t inverted_here = 0;
    uint32_t hint = kNoTriangle;
    for (int64_t t = begin; t < end; ++t) {
      const render::CapturedVertex* v = &captured.vertices[static_cast<size_t>(3 * t)];
      if (is_filler(v)) continue;
      const glm::dvec3 a(v[0].x, v[0].y, v[0].z), b(v[1].x, v[1].y, v[1].z), c(v[2].x, v[2].y, v[2].z);
      const glm::dvec3 ab = b - a, ac = c - a, normal = glm::cross(ab, ac), middle = (a + b + c) / 3.0;
      const double slack = world_slack(std::max({glm::length(a), glm::length(b), glm::length(c)})) +
                           kDoubleSlack * glm::length(captured.eye);
      if (glm::length(normal) <= slack * (glm::length(ab) + glm::length(ac) + glm::length(c - b))) continue;
      const auto facing = [&](uint32_t triangle) {
        const Triangle s = source.mesh().triangle(triangle);
        return glm::dot(normal, glm::cross(s[1] - s[0], s[2] - s[0]));
      };
      const double reach = bound(v[0].node) + slack;
      const Closest closest = source.closest(middle + offset, hint);
      hint = closest.triangle;
      if (closest.distance > reach || facing(closest.triangle) >= 0.0) continue;
      const auto alike = [&](uint32_t triangle) { return facing(triangle) > 0.0; };
      inverted_here += source.any_within(middle + offset, reach, alike) ? 0 : 1;
    }
    inverted += inverted_here;
  });
  return {inverted, std::nullopt};
}

}  // namespace lodlab::instrument
