// SPDX-License-Identifier: MIT
// Where the points of faces lie, and what decides of their lines (refine.h).
#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/parallel.h"
#include "methods/subdivision/subdivision.h"
#include "subdivision/displace.h"

namespace lodlab::subdivision {
namespace {

constexpr int64_t kGrain = 64;

/// What floats round of lengths of this size on the way, and more.
constexpr double kRounding = 1e-6;

float above(double value) { return static_cast<float>(value * (1.0 + kRounding)); }

/// The largest stretch of the map from an equilateral triangle with sides of 1 to this one.
double stretch(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const glm::dvec3 u = b - a, v = (2.0 * (c - a) - u) / std::sqrt(3.0);
  const double uu = glm::dot(u, u), uv = glm::dot(u, v), vv = glm::dot(v, v);
  return std::sqrt(0.5 * (uu + vv + std::hypot(uu - vv, 2.0 * uv)));
}

LineRecord larger(LineRecord a, const LineRecord& b) {
  for (int level = 0; level < 12; ++level) {
    const int shift = 8 * (level & 3);
    uint32_t& word = a.bounds[level >> 2];
    const uint32_t code = std::max(code_of(a, level), code_of(b, level));
    word = (word & ~(uint32_t{255} << shift)) | code << shift;
  }
  a.scale = std::max(a.scale, b.scale);
  a.spread = std::max(a.spread, b.spread);
  a.swell = std::max(a.swell, b.swell);
  a.slope = std::max(a.slope, b.slope);
  return a;
}

}  // namespace

Displaced::Displaced(const Samples& samples, std::vector<float> heights)
    : samples_(samples), heights_(std::move(heights)) {
  const std::vector<Samples::Place> places = samples.places();
  for (size_t s = 0; s < places.size(); ++s)
    positions_.push_back(subdivision::displaced(places[s].position, places[s].normal, heights_[s]));
}

void Displaced::of_face(int64_t face, std::span<vec3> out) const {
  const int n = samples_.pattern().n();
  size_t at = 0;
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i + j <= n; ++i) out[at++] = positions_[static_cast<size_t>(samples_.of(face, i, j))];
  }
}

Records records_at_rest(const Stored& stored, const Displaced& displaced) {
  const Samples& samples = displaced.samples();
  const ControlMesh& control = stored.control;
  const int levels = samples.pattern().levels();
  const size_t codes = stored.codes_a_face();
  Records out;
  out.face.resize(control.faces.size());
  out.edge.resize(static_cast<size_t>(samples.edges().count()));
  parallel_for(samples.control_faces(), kGrain, [&](int64_t begin, int64_t end) {
    std::vector<int64_t> of(static_cast<size_t>(samples.pattern().points()));
    for (int64_t f = begin; f < end; ++f) {
      FaceRecord& face = out.face[static_cast<size_t>(f)];
      face = {};
      const Face& corners = control.faces[static_cast<size_t>(f)];
      double far = 0.0, longest = 0.0;
      for (size_t k = 0; k < 3; ++k) {
        face.corner[k] = corners[k];
        face.edge[k] = static_cast<uint32_t>(samples.edge(f, static_cast<int>(k)));
        const glm::dvec3 &p = control.positions[corners[k]], &q = control.positions[corners[(k + 1) % 3]];
        far = std::max(far, glm::length(p));
        longest = std::max(longest, glm::distance(p, q));
      }
      samples.of_face(f, of);
      face.low = face.high = displaced.heights()[static_cast<size_t>(of[0])];
      for (const int64_t s : of) {
        face.low = std::min(face.low, displaced.heights()[static_cast<size_t>(s)]);
        face.high = std::max(face.high, displaced.heights()[static_cast<size_t>(s)]);
      }
      LineRecord& inner = face.inner;
      const uint8_t* const code = &stored.codes[static_cast<size_t>(f) * codes];
      for (int level = 0; level < levels; ++level)
        inner.bounds[level >> 2] |= uint32_t{code[level]} << (8 * (level & 3));
      inner.scale = 1.0f;
      inner.spread = above(stretch(control.positions[corners[0]], control.positions[corners[1]],
                                   control.positions[corners[2]]));
      const double highest = std::max(std::abs(face.low), std::abs(face.high));
      inner.swell = above(highest + kRounding * (far + inner.spread));
      const double curved = highest + double{bound_of_code(stored.shape.low_code, code[levels])};
      inner.slope = longest > 0.0 ? above(curved / longest) : 0.0f;
      face.error = above(stored.bound(f, levels - 1) + kRounding * far);
    }
  });
  for (size_t e = 0; e < out.edge.size(); ++e) {
    const auto sides = samples.edges().of(static_cast<int64_t>(e));
    out.edge[e] = out.face[sides[0] / 3].inner;
    for (const uint32_t side : sides) out.edge[e] = larger(out.edge[e], out.face[side / 3].inner);
  }
  return out;
}

}  // namespace lodlab::subdivision
