// SPDX-License-Identifier: MIT
// A chunk's vertex: whole grid position, height between its own and its morph target's, in quanta.
#include "common/position.glsl"
#include "common/surface_out.glsl"

layout(location = 0) in uvec4 a_vertex;  // column and row in the chunk, height, morph target
layout(location = 1) in vec3 a_chunk;    // column and row of its corner; morph: 1 own height, 0 target
layout(location = 2) in uvec3 a_tag;     // first skirt vertex, node, side in cells << 8 | level

uniform vec2 u_quantum;  // quantum, base
#ifdef LODLAB_COLORS
uniform float u_texels;  // texture cells a side
#endif

void main() {
  ivec2 cell = ivec2(a_chunk.xy) + ivec2(a_vertex.xy);
  precise float own = float(a_vertex.z);
  precise float target = float(a_vertex.w);
  precise float height = (target + a_chunk.z * (own - target) + u_quantum.y) * u_quantum.x;
  bool filler = uint(gl_VertexID) >= a_tag.x;
  vec2 grid = surface_grid(cell);
#ifdef LODLAB_COVERAGE
  // A skirt stands on a line between cells; its bottom is moved to the chunk's own side of that line.
  if (filler) {
    uint side = a_tag.z >> 8;
    grid += 0.5 * (vec2(equal(a_vertex.xy, uvec2(0u))) - vec2(equal(a_vertex.xy, uvec2(side))));
  }
#endif
#ifdef LODLAB_COLORS
  v_colors = vec3((vec2(a_vertex.xy) / float(a_tag.z >> 8) * u_texels + 0.5) / (u_texels + 1.0), 0.0);
#endif
  emit_surface(surface_position(cell, height), grid, a_tag.y, a_tag.z & 255u, filler);
}
