// SPDX-License-Identifier: MIT
#include "instrument/mesh_error.h"

#include <cmath>

#include "geometry/mesh_distance.h"
#include "instrument/screen.h"

namespace lodlab::instrument {
namespace {

/// Pieces of surface, 10 us each. One surface cut into other triangles takes about 10 a triangle; most take a
/// few thousand in all.
constexpr int64_t kMostPieces = int64_t{1} << 24, kMostPiecesPerTriangle = 32;

}  // namespace

int64_t most_pieces(const MeshSurface& a, const MeshSurface& b) {
  return kMostPieces + kMostPiecesPerTriangle * (a.mesh().triangles() + b.mesh().triangles());
}

double vertex_error_px(const WeldedMesh& from, const std::vector<Closest>& there, const Camera& camera,
                       const glm::dvec3& offset) {
  double worst = kUndefined;
  for (size_t i = 0; i < there.size(); ++i) {
    const glm::dvec3 sample = from.positions[i] + offset;
    if (!in_frustum(camera, sample)) continue;
    const double distance = there[i].distance;
    const bool moved = distance > 0.0 && distance < kInfinite;
    worst = std::fmax(worst, moved ? screen_distance(camera, sample, there[i].point + offset) : distance);
  }
  return worst;
}

TwoSided two_sided(const MeshSurface& source, const MeshSurface& drawn, const std::vector<Closest>& at_source,
                   double extent) {
  TwoSided out;
  if (drawn.mesh().faces.empty()) {
    out.max_to_drawn = out.rms_to_drawn = kInfinite;
    return out;
  }
  const int64_t most = most_pieces(source, drawn);
  const auto there = surface_distance(source.mesh(), at_source, drawn, extent, most);
  const auto back =
      surface_distance(drawn.mesh(), closest_to_vertices(drawn.mesh(), source), source, extent, most);
  return {there.max, there.rms, back.max, back.rms};
}

}  // namespace lodlab::instrument
