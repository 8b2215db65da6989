// SPDX-License-Identifier: MIT
// A vertex of a stored mesh (method/mesh_pages.h).
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

uniform uvec2 u_tag;  // node, level

void main() {
  emit_surface(mesh_position(a_high, a_low), vec2(0.0), u_tag.x, u_tag.y, false);
#ifdef LODLAB_COLORS
  v_colors = a_color.rgb / 255.0;
#endif
}
