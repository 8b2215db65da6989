// SPDX-License-Identifier: MIT
// Positions of mesh vertices, a function of the vertex and the eye alone: two nodes round a shared vertex alike. Both
// are sums of two floats; the difference of two floats that are close is exact, so that what is lost is lost at the
// distance to the eye.
#include "common/camera.glsl"

/// Position relative to the eye of a vertex at high + low.
vec3 mesh_position(vec3 high, vec3 low) {
  precise vec3 relative = (high - camera.eye_world.xyz) + (low - camera.eye_low.xyz);
  return relative;
}
