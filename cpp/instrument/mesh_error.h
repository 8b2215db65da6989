// SPDX-License-Identifier: MIT
// The accuracy columns of a mesh: its drawn triangles against the source mesh, in both directions. The
// corresponding point of a source point is the closest one of the drawn surface. Fillers are left out by the
// caller.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "geometry/mesh_surface.h"
#include "geometry/view.h"
#include "instrument/sample_error.h"
#include "render/frame.h"

namespace lodlab::instrument {

/// Source units and pixels. With nothing drawn, what starts at the source is inf and what starts at the drawn
/// surface nan; of a surface without area the rms is nan. See mesh_distance.h for how maxima are found.
struct MeshAccuracy {
  double measured_max = kUndefined, measured_rms = kUndefined;  ///< the larger of both directions
  double measured_max_source_to_drawn = kUndefined, measured_max_drawn_to_source = kUndefined;
  double measured_rms_source_to_drawn = kUndefined, measured_rms_drawn_to_source = kUndefined;
  double measured_px_max = kUndefined;  ///< over the source's vertices inside the frustum, hidden or not
  double measured_px_p99 = kUndefined, measured_px_rms = kUndefined;  ///< over the reference's covered pixels
};

/// What a view adds: pixel columns are nan without it, and those over pixels without a reference, which is a
/// picture of the source with depth. A view that sees nothing leaves them nan.
struct MeshView {
  const Camera* camera = nullptr;
  const render::Picture* reference = nullptr;
};

/// `faces` index `positions`; `drawn` are triangles in the source's coordinates. Throws InvalidInput for a
/// source without triangles, an index out of range, a position that is not finite or beyond kFarthestMesh
/// (naming the triangle), and a reference without a camera or of another size; Unsupported as
/// surface_distance() does.
MeshAccuracy mesh_accuracy(std::span<const glm::dvec3> positions,
                           std::span<const std::array<uint32_t, 3>> faces, std::span<const Triangle> drawn,
                           const MeshView& view = {});

/// The distances between two surfaces, `at_source` being closest_to_vertices() of the source. `extent`: of
/// both together. See mesh_distance.h for how maxima are found.
TwoSided two_sided(const MeshSurface& source, const MeshSurface& drawn, const std::vector<Closest>& at_source,
                   double extent);

/// The largest screen distance, pixels, from vertices inside the frustum to where they are closest; `offset`
/// leads from mesh coordinates to those relative to the eye. nan when none is inside.
double vertex_error_px(const WeldedMesh& from, const std::vector<Closest>& there, const Camera& camera,
                       const glm::dvec3& offset);

/// Coordinates and their differences fit 32-bit floats, their products doubles.
inline constexpr double kFarthestMesh = 1e36;

}  // namespace lodlab::instrument
