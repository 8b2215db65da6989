// SPDX-License-Identifier: MIT
// One sample a vertex: its (column, row) and its height.
#include "common/position.glsl"
#include "common/surface_out.glsl"

layout(location = 0) in uvec2 col_row;
layout(location = 1) in float height;

#if defined(LODLAB_COLORS) || defined(LODLAB_NORMALS)
uniform vec2 samples;  // columns and rows that maps span
#endif

void main() {
  const ivec2 cell = ivec2(col_row);
  emit_surface(surface_position(cell, height), surface_grid(cell), 0u, 0u, false);
#ifdef LODLAB_COLORS
  v_colors = vec3((vec2(col_row) + 0.5) / samples, 0.0);
#endif
#ifdef LODLAB_NORMALS
  v_normals = vec3((vec2(col_row) + 0.5) / samples, 0.0);
#endif
}
