// SPDX-License-Identifier: MIT
// Where the points of faces lie, and what decides of their lines (refine.h).
#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/parallel.h"
#include "geometry/mesh_surface.h"
#include "methods/subdivision/subdivision.h"
#include "subdivision/displace.h"

namespace lodlab::subdivision {
namespace {

constexpr int64_t kGrain = 64;

/// What floats round of lengths of this size on the way, and more.
constexpr double kRounding = 1e-6;

/// Of bounds under a pose: more is asked of no face.
constexpr double kMostStretch = 16.0;

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

/// What depends on where the corners of a face lie.
void place(FaceRecord& face, const Triangle& at, double finest_bound) {
  double far = 0.0;
  for (const glm::dvec3& p : at) far = std::max(far, glm::length(p));
  face.inner.spread = above(stretch(at[0], at[1], at[2]));
  const double highest = std::max(std::abs(face.low), std::abs(face.high));
  face.inner.swell = above(highest + kRounding * (far + face.inner.spread));
  face.error = above(finest_bound + kRounding * far);
}

/// The largest of a linear map's stretches: of map^T map the largest eigenvalue's root (Smith 1961).
double largest_stretch(const glm::dmat3& map) {
  glm::dmat3 square = glm::transpose(map) * map;
  const double mean = (square[0][0] + square[1][1] + square[2][2]) / 3.0;
  for (int k = 0; k < 3; ++k) square[k][k] -= mean;
  const double spread = std::sqrt(
      (glm::dot(square[0], square[0]) + glm::dot(square[1], square[1]) + glm::dot(square[2], square[2])) /
      6.0);
  if (!(spread > 0.0)) return std::sqrt(mean);
  const double turn = std::clamp(0.5 * glm::determinant(square / spread), -1.0, 1.0);
  return std::sqrt(mean + 2.0 * spread * std::cos(std::acos(turn) / 3.0));
}

/// By how much a pose stretches the prism over a face, of points at its corners: at most kMostStretch.
double prism_stretch(const FaceRecord& face, const RestControl& rest, const PosedControl& posed) {
  double most = 0.0;
  for (size_t k = 0; k < 3; ++k) {
    const uint32_t a = face.corner[k], b = face.corner[(k + 1) % 3], c = face.corner[(k + 2) % 3];
    for (const float height : {face.low, face.high}) {
      const auto slopes = [&](const std::vector<vec3>& p, const std::vector<vec3>& n) {
        const auto end = [&](uint32_t v) { return glm::dvec3(p[v]) + double{height} * glm::dvec3(n[v]); };
        return glm::dmat3(end(b) - end(a), end(c) - end(a), glm::dvec3(n[a]));
      };
      const glm::dmat3 from = slopes(rest.positions, rest.normals),
                       to = slopes(posed.positions, posed.normals);
      if (glm::determinant(from) == 0.0) return kMostStretch;
      most = std::max(most, largest_stretch(to * glm::inverse(from)));
    }
  }
  return most < kMostStretch ? most : kMostStretch;
}

void join_edges(Records& records, const Samples& samples) {
  for (size_t e = 0; e < records.edge.size(); ++e) {
    const auto sides = samples.edges().of(static_cast<int64_t>(e));
    records.edge[e] = records.face[sides[0] / 3].inner;
    for (const uint32_t side : sides) records.edge[e] = larger(records.edge[e], records.face[side / 3].inner);
  }
}

}  // namespace

Displaced::Displaced(const Samples& samples, const std::vector<float>& heights)
    : samples_(samples), heights_(&heights) {
  place(samples.places());
}

Displaced Displaced::at(const RestControl& rest, const PosedControl& posed) const {
  ControlMesh control;
  control.positions.assign(posed.positions.begin(), posed.positions.end());
  control.normals.assign(posed.normals.begin(), posed.normals.end());
  control.faces = rest.faces;
  Displaced out = *this;
  out.place(samples_.places(control));
  return out;
}

void Displaced::place(const std::vector<Samples::Place>& places) {
  positions_.resize(places.size());
  for (size_t s = 0; s < places.size(); ++s)
    positions_[s] = subdivision::displaced(places[s].position, places[s].normal, heights()[s]);
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
      double longest = 0.0;
      for (size_t k = 0; k < 3; ++k) {
        face.corner[k] = corners[k];
        face.edge[k] = static_cast<uint32_t>(samples.edge(f, static_cast<int>(k)));
        longest = std::max(
            longest, glm::distance(control.positions[corners[k]], control.positions[corners[(k + 1) % 3]]));
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
      inner.drawn = static_cast<uint32_t>(levels);
      place(face,
            {control.positions[corners[0]], control.positions[corners[1]], control.positions[corners[2]]},
            stored.bound(f, levels - 1));
      const double highest = std::max(std::abs(face.low), std::abs(face.high));
      const double curved = highest + double{bound_of_code(stored.shape.low_code, code[levels])};
      inner.slope = longest > 0.0 ? above(curved / longest) : 0.0f;
    }
  });
  join_edges(out, samples);
  return out;
}

std::shared_ptr<const Posed> posed(const SubdivisionHierarchy& hierarchy, const Pose& pose) {
  const RestControl& rest = hierarchy.rest();
  const auto out = std::make_shared<Posed>();
  out->control = posed_control(rest, pose);
  if (out->control.positions == rest.positions) return nullptr;
  out->records = hierarchy.records();
  const int finest = hierarchy.pattern().levels() - 1;
  parallel_for(static_cast<int64_t>(rest.faces.size()), kGrain, [&](int64_t begin, int64_t end) {
    for (int64_t f = begin; f < end; ++f) {
      FaceRecord& face = out->records.face[static_cast<size_t>(f)];
      face.inner.scale = static_cast<float>(prism_stretch(face, rest, out->control));
      const std::vector<vec3>& at = out->control.positions;
      place(face,
            {glm::dvec3(at[face.corner[0]]), glm::dvec3(at[face.corner[1]]), glm::dvec3(at[face.corner[2]])},
            hierarchy.stored().bound(f, finest) * double{face.inner.scale});
    }
  });
  join_edges(out->records, hierarchy.samples());
  return out;
}

}  // namespace lodlab::subdivision
