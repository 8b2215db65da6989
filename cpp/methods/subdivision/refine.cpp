// SPDX-License-Identifier: MIT
#include "methods/subdivision/refine.h"

#include <array>
#include <cmath>

#include "geometry/two_floats.h"

namespace lodlab::subdivision {

Step step_of(const Projector& projector, double tau) {
  const double K = projector.K, s = projector.s, n = projector.n;
  Step out;
  out.tau = static_cast<float>(tau);
  if (projector.kind == Projection::kPaper) {
    out.kappa = static_cast<float>(K / tau + 1.0);
    out.never = static_cast<float>(n * tau / K * (1.0 - 1e-6));
  } else {  // strict, solved for the distance (common/projection.h)
    out.kappa = static_cast<float>(s * (1.0 + K * s / tau) + 1.0);
    out.never = static_cast<float>(n * tau / (K * s) * (1.0 - 1e-6));
  }
  const double gain = K / tau;
  out.gain = static_cast<float>(gain * gain);
  return out;
}

Uniforms uniforms_of(const SubdivisionHierarchy& hierarchy, const Camera& camera, int metric) {
  Uniforms out = {};
  const glm::dvec3 eye = camera.eye - hierarchy.centre();
  for (int k = 0; k < 3; ++k) split(eye[k], out.eye_high[k], out.eye_low[k]);
  for (int i = 0; i < 5; ++i) {
    const double offset = i == 4 ? -camera.near_plane : 0.0;
    out.frustum.plane[i] = glm::vec4(glm::vec3(camera.planes[static_cast<size_t>(i)]), offset);
  }
  out.metric = metric;
  out.d = hierarchy.pattern().d;
  out.low_code = hierarchy.stored().shape.low_code;
  return out;
}

Corners Refinement::corners(const FaceRecord& face) const {
  const auto at = [&](uint32_t v) {
    const vec3& p = lying_.positions[v];
    const float *const high = uniforms_.eye_high, *const low = uniforms_.eye_low;
    return (p - vec3(high[0], high[1], high[2])) - vec3(low[0], low[1], low[2]);
  };
  return {at(face.corner[0]), at(face.corner[1]), at(face.corner[2])};
}

bool Refinement::visible(size_t f) const {
  const FaceRecord& face = lying_.records.face[f];
  const auto along = [&](int k) { return lying_.normals[face.corner[k]]; };
  return face_seen(face, corners(face), {along(0), along(1), along(2)}, uniforms_.frustum);
}

bool Refinement::lacks(size_t f, const Records& all) const {
  const FaceRecord& face = lying_.records.face[f];
  const int n = 1 << uniforms_.d;
  const std::array<ivec2, 3> corner = {ivec2(0, 0), ivec2(n, 0), ivec2(0, n)};
  for (size_t k = 0; k < 3; ++k) {
    if (lying_.records.edge[face.edge[k]].drawn != 0) continue;
    const float limit = limit_of(frame_, all.edge[face.edge[k]], 0);
    if (line_between(frame_, limit, corners(face), corner[k], corner[(k + 1) % 3]).wants) return true;
  }
  return false;
}

int64_t Refinement::for_triangles(size_t f, const std::function<void(const PatternTriangle&)>& visit) const {
  const FaceRecord& face = lying_.records.face[f];
  const Corners at = corners(face);
  const auto edge_record = [&](uint32_t e) -> const LineRecord& { return lying_.records.edge[e]; };
  const Limits limits = limits_of(frame_, face, edge_record);
  const Metric metric = metric_of(at);
  const auto line = [&](ivec2 p, ivec2 q) {
    return line_between(frame_, limits.of[limit_place(frame_, p, q)], at, p, q);
  };
  const int n = 1 << uniforms_.d;
  std::array<PatternTriangle, 2 * kMostDoublings + 2> stack;
  size_t top = 0;
  stack[top++] = {{0, 0}, {n, 0}, {0, n}};
  int64_t tested = 0;
  while (top > 0) {
    PatternTriangle t = stack[--top];
    for (;;) {
      ++tested;
      const int side = split_of(frame_, metric, line(t.p0, t.p1), line(t.p1, t.p2), line(t.p2, t.p0), t);
      if (side == 0) {
        visit(t);
        break;
      }
      t = turned(t, side);
      if (swaps(t)) {
        visit(swapped(t));
        break;
      }
      const ivec2 middle = middle_point(t);
      stack[top++] = {t.p1, t.p2, middle};
      t = {t.p2, t.p0, middle};
    }
  }
  return tested;
}

int64_t triangles_at_level(const Pattern& pattern, int level) {
  LineRecord line = {};
  line.drawn = static_cast<uint32_t>(level);
  const Records records{{{{0, 1, 2}, {0, 1, 2}, line, 0.0f, 0.0f, 0.0f}}, {line, line, line}};
  const std::vector<vec3> anywhere(3, vec3(1.0f));
  Uniforms u = {};
  u.metric = LODLAB_METRIC_LEVEL;
  u.d = pattern.d;
  const Lying lies{anywhere, anywhere, records};
  int64_t out = 0;
  Refinement(lies, u, {}).for_triangles(0, [&](const PatternTriangle&) { ++out; });
  return out;
}

}  // namespace lodlab::subdivision
