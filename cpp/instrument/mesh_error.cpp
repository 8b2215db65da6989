// SPDX-License-Identifier: MIT
#include "instrument/mesh_error.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/bounds.h"
#include "geometry/mesh_distance.h"
#include "instrument/pixel_error.h"
#include "instrument/screen.h"

namespace lodlab::instrument {
namespace {

/// Work that a maximum may take, in pieces of surface (10 us each): minutes. One surface cut into other
/// triangles takes about 10 a triangle; most take a few thousand in all.
constexpr int64_t kMostPieces = int64_t{1} << 24, kMostPiecesPerTriangle = 32;

/// The box of triangles that are all as they must be.
Box checked_box(std::span<const Triangle> triangles, const char* whose) {
  Box box;
  for (size_t i = 0; i < triangles.size(); ++i) {
    for (const glm::dvec3& p : triangles[i]) {
      if (std::max({std::abs(p.x), std::abs(p.y), std::abs(p.z)}) <= kFarthestMesh && !std::isnan(p.x) &&
          !std::isnan(p.y) && !std::isnan(p.z)) {
        box.add(p);
        continue;
      }
      char text[200];
      std::snprintf(
          text, sizeof text,
          "mesh_accuracy: %s triangle %zu has a vertex at (%.9g, %.9g, %.9g); positions must be finite, "
          "and within %g",
          whose, i, p.x, p.y, p.z, kFarthestMesh);
      throw InvalidInput(text);
    }
  }
  return box;
}

std::vector<Triangle> source_triangles(std::span<const glm::dvec3> positions,
                                       std::span<const std::array<uint32_t, 3>> faces) {
  if (faces.empty()) throw InvalidInput("mesh_accuracy: the source has no triangles");
  std::vector<Triangle> out(faces.size());
  for (size_t i = 0; i < faces.size(); ++i) {
    for (size_t k = 0; k < 3; ++k) {
      if (faces[i][k] >= positions.size()) {
        throw InvalidInput("mesh_accuracy: source triangle " + std::to_string(i) + " names vertex " +
                           std::to_string(faces[i][k]) + " of " + std::to_string(positions.size()));
      }
      out[i][k] = positions[faces[i][k]];
    }
  }
  return out;
}

PixelError pixel_error(const MeshSurface& drawn, const render::Picture& reference, const Camera& camera,
                       const glm::dvec3& offset) {
  return lodlab::instrument::pixel_error(
      [&](std::span<const glm::dvec3> points, std::span<glm::dvec3> out) {
        for (size_t i = 0; i < points.size(); ++i)
          out[i] = drawn.closest(points[i] - offset).point + offset;  // NaN where nothing is drawn
      },
      reference, camera);
}

}  // namespace

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
  const int64_t triangles = source.mesh().triangles() + drawn.mesh().triangles();
  const int64_t most = kMostPieces + kMostPiecesPerTriangle * triangles;
  const auto there = surface_distance(source.mesh(), at_source, drawn, extent, most);
  const auto back =
      surface_distance(drawn.mesh(), closest_to_vertices(drawn.mesh(), source), source, extent, most);
  return {there.max, there.rms, back.max, back.rms};
}

MeshAccuracy mesh_accuracy(std::span<const glm::dvec3> positions,
                           std::span<const std::array<uint32_t, 3>> faces, std::span<const Triangle> drawn,
                           const MeshView& view) {
  if (view.reference != nullptr && view.camera == nullptr)
    throw InvalidInput("mesh_accuracy: a reference depth needs the view that it was drawn for");
  Box box;
  WeldedMesh source, shown;
  glm::dvec3 centre;
  {
    const std::vector<Triangle> triangles = source_triangles(positions, faces);
    box = checked_box(triangles, "source");
    centre = box.center();
    box.add(checked_box(drawn, "drawn"));
    source = weld(triangles, centre);
    shown = weld(drawn, centre);
  }
  const MeshSurface source_surface(source), drawn_surface(shown);
  const std::vector<Closest> at_source = closest_to_vertices(source, drawn_surface);
  MeshAccuracy out;
  const TwoSided both = two_sided(source_surface, drawn_surface, at_source, glm::distance(box.lo, box.hi));
  out.measured_max_source_to_drawn = both.max_to_drawn;
  out.measured_rms_source_to_drawn = both.rms_to_drawn;
  out.measured_max_drawn_to_source = both.max_to_source;
  out.measured_rms_drawn_to_source = both.rms_to_source;
  out.measured_max = std::fmax(out.measured_max_source_to_drawn, out.measured_max_drawn_to_source);
  out.measured_rms = std::fmax(out.measured_rms_source_to_drawn, out.measured_rms_drawn_to_source);
  if (view.camera == nullptr) return out;
  const glm::dvec3 offset = centre - view.camera->eye;
  out.measured_px_max = vertex_error_px(source, at_source, *view.camera, offset);
  if (view.reference != nullptr) {
    const PixelError pixels = pixel_error(drawn_surface, *view.reference, *view.camera, offset);
    out.measured_px_p99 = pixels.p99;
    out.measured_px_rms = pixels.rms;
  }
  return out;
}

}  // namespace lodlab::instrument
