// SPDX-License-Identifier: MIT
// Distances on the screen, and which points count there.
#pragma once

#include <limits>

#include "geometry/height_field.h"
#include "geometry/horizon.h"
#include "geometry/view.h"

namespace lodlab::instrument {

/// Whether a point relative to the eye lies inside the frustum, its planes included.
inline bool in_frustum(const Camera& camera, const glm::dvec3& relative) {
  for (int i = 0; i < 4; ++i) {
    if (glm::dot(camera.planes[i], relative) < 0.0) return false;
  }
  return camera.depth(relative) >= camera.near_plane;
}

/// Which samples of a source may be seen in a view: those inside the frustum. On a planet that closes
/// (geometry/horizon.h) not those beyond its horizon: their way to the eye passes through the sphere below
/// which no sample lies. It is the source's own, whatever draws it. A method may leave out what a smaller
/// sphere hides from an eye above the ground.
class InView {
 public:
  InView(const FieldFrame& source, bool has_voids, const Camera& camera)
      : camera_(camera),
        horizon_(closes(source, has_voids) ? source.radius + source.z_min : 0.0, camera.eye) {}
  const Camera& camera() const { return camera_; }
  /// A sample, relative to the eye.
  bool operator()(const glm::dvec3& relative) const {
    return in_frustum(camera_, relative) && !horizon_.hides(relative);
  }

 private:
  const Camera& camera_;
  Horizon horizon_;
};

/// Pixels between two points relative to the eye. A point behind the near plane is clamped to it along
/// the segment; when both are behind it, nothing of the segment can be seen and the distance is 0.
inline double screen_distance(const Camera& camera, glm::dvec3 p, glm::dvec3 q) {
  const double zp = camera.depth(p), zq = camera.depth(q), near = camera.near_plane;
  if (zp < near && zq < near) return 0.0;
  if (zp < near) p = q + (zq - near) / (zq - zp) * (p - q);
  if (zq < near) q = p + (zp - near) / (zp - zq) * (q - p);
  return glm::distance(camera.project(p), camera.project(q));
}

}  // namespace lodlab::instrument
