// SPDX-License-Identifier: MIT
#include "instrument/orientation.h"

#include <algorithm>
#include <atomic>

#include "base/parallel.h"
#include "geometry/mesh_edges.h"
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

/// The area of each captured triangle: negative where it faces against the source, 0 where nothing is said.
std::vector<double> facing_areas(const MeshSurface& source, const glm::dvec3& centre,
                                 const render::Captured& captured, const NodeBound& bound) {
  const glm::dvec3 offset = captured.eye - centre;
  std::vector<double> out(static_cast<size_t>(captured.triangles()), 0.0);
  parallel_for(captured.triangles(), 1024, [&](int64_t begin, int64_t end) {
    uint32_t hint = kNoTriangle;
    for (int64_t t = begin; t < end; ++t) {
      const render::CapturedVertex* v = &captured.vertices[static_cast<size_t>(3 * t)];
      if (is_filler(v)) continue;
      const glm::dvec3 a(v[0].x, v[0].y, v[0].z), b(v[1].x, v[1].y, v[1].z), c(v[2].x, v[2].y, v[2].z);
      const glm::dvec3 ab = b - a, ac = c - a, normal = glm::cross(ab, ac), middle = (a + b + c) / 3.0;
      const double slack = world_slack(std::max({glm::length(a), glm::length(b), glm::length(c)})) +
                           kDoubleSlack * glm::length(captured.eye);
      const double area = glm::length(normal);
      if (area <= slack * (glm::length(ab) + glm::length(ac) + glm::length(c - b))) continue;
      const auto alike = [&](uint32_t triangle) {
        const Triangle s = source.mesh().triangle(triangle);
        return glm::dot(normal, glm::cross(s[1] - s[0], s[2] - s[0]));
      };
      const double reach = bound(v[0].node) + slack;
      const Closest closest = source.closest(middle + offset, hint);
      hint = closest.triangle;
      if (closest.distance > reach) continue;
      const double there = alike(closest.triangle);
      const bool with = there > 0.0 || source.any_within(middle + offset, reach, [&](uint32_t triangle) {
        return alike(triangle) > 0.0;
      });
      out[static_cast<size_t>(t)] = with ? area : there < 0.0 ? -area : 0.0;
    }
  });
  return out;
}

/// Triangles joined across edges along which they run in opposite senses.
Sets pieces_of(const render::Captured& captured) {
  std::vector<Triangle> triangles(static_cast<size_t>(captured.triangles()));
  for (size_t i = 0; i < captured.vertices.size(); ++i)
    triangles[i / 3][i % 3] = {captured.vertices[i].x, captured.vertices[i].y, captured.vertices[i].z};
  const WeldedMesh mesh = weld(triangles, glm::dvec3(0.0));
  const MeshEdges edges = mesh_edges(mesh.faces, static_cast<int64_t>(mesh.positions.size()));
  Sets out(captured.triangles());
  for (int64_t e = 0; e < edges.count(); ++e) {
    const std::span<const uint32_t> sides = edges.of(e);
    for (size_t i = 1; i < sides.size(); ++i) {
      for (size_t j = 0; j < i; ++j) {
        if (vertex_of(mesh.faces, sides[i]) == vertex_of(mesh.faces, side_end(sides[j])))
          out.join(sides[i] / 3, sides[j] / 3);
      }
    }
  }
  return out;
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
  const std::vector<double> facing = facing_areas(source, centre, captured, bound);
  if (std::none_of(facing.begin(), facing.end(), [](double area) { return area < 0.0; })) return {0, {}};
  Sets pieces = pieces_of(captured);
  std::vector<double> areas(facing.size(), 0.0);
  for (uint32_t t = 0; t < facing.size(); ++t) areas[pieces.find(t)] += facing[t];
  int64_t inverted = 0;
  for (uint32_t t = 0; t < facing.size(); ++t)
    inverted += areas[pieces.find(t)] < 0.0 && !is_filler(&captured.vertices[3 * size_t{t}]) ? 1 : 0;
  return {inverted, {}};
}

}  // namespace lodlab::instrument
