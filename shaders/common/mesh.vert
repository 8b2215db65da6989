// SPDX-License-Identifier: MIT
// A vertex of a stored mesh (method/mesh_pages.h): a source's own, or a surface over a flat height field.
#include "common/mesh_position.glsl"
#include "common/surface_out.glsl"

layout(location = 0) in vec3 a_high;
#ifdef MESH_LOW
layout(location = 1) in vec3 a_low;
#else
const vec3 a_low = vec3(0.0);
#endif
#ifdef LODLAB_COLORS
layout(location = 2) in vec4 a_color;
#endif
layout(location = 3) in uvec2 a_tag;  // node, level

void main() {
  const vec3 relative = mesh_position(a_high, a_low);
#ifdef LODLAB_MESH
  const vec2 grid = vec2(0.0);
#else
  const vec2 grid = vec2(relative.x, -relative.y) / camera.spacing + camera.eye_frac;
#endif
  emit_surface(relative, grid, a_tag.x, a_tag.y, false);
#ifdef LODLAB_COLORS
  v_colors = a_color.rgb / 255.0;
#endif
}
