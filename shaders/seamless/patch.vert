// SPDX-License-Identifier: MIT
// A lattice point of a patch. Its height comes as an attribute, from the patch's slot; which point it is follows
// from its number there (slots.h).
#include "common/position.glsl"
#include "common/surface_out.glsl"

layout(location = 0) in float a_height;
layout(location = 1) in ivec3 a_place;  // first column and row; number of the slot's first height
// Node; lattice point where its square begins, u << 24 | v << 16; level << 8 | log2 of the stride of its lattice.
layout(location = 2) in uvec2 a_tag;
// In the square's tile of a map: u and v of its first sample; from one sample to the next; layer.
#ifdef LODLAB_COLORS
layout(location = 3) in vec4 a_colors;
#endif
#ifdef LODLAB_NORMALS
layout(location = 4) in vec4 a_normals;
#endif

uniform ivec2 u_last;    // column and row
uniform int u_segments;  // of an edge at its finest

const int kStrip = 16;

void main() {
  int number = gl_VertexID - a_place.z, side = u_segments, coarser = 0;
#ifdef LODLAB_AVERAGE
  for (;; ++coarser) {  // a lattice for each resolution, the finest first
    int heights = max(side / kStrip, 1) * (min(side, kStrip) + 1) * (side + 1);
    if (number < heights) break;
    number -= heights;
    side >>= 1;
  }
#endif
  int pitch = min(side, kStrip) + 1;
  int line = int((float(number) + 0.5) / float(pitch));  // exact: a slot has few heights
  int strip = int((float(line) + 0.5) / float(side + 1));
  ivec2 at = ivec2(number - line * pitch + strip * kStrip, line - strip * (side + 1)) << coarser;
  int stride = int(a_tag.y & 255u);
  ivec2 cell = min(a_place.xy + (at << stride), u_last);
  uint level = a_tag.y >> 8 & 255u;
#ifdef LODLAB_PARTS
  // The last vertex of a strip's triangle lies on a diagonal, of a tile's it never does (ranges.h).
  level = at.x == at.y || at.x + at.y == u_segments ? 5u : 3u;
#endif
  emit_surface(surface_position(cell, a_height), surface_grid(cell), a_tag.x, level, false);
#if defined(LODLAB_COLORS) || defined(LODLAB_NORMALS)
  vec2 beyond = vec2(cell - a_place.xy - (ivec2(a_tag.yy >> uvec2(24, 16) & 255u) << stride));
#endif
#ifdef LODLAB_COLORS
  v_colors = vec3(a_colors.xy + beyond * a_colors.z, a_colors.w);
#endif
#ifdef LODLAB_NORMALS
  v_normals = vec3(a_normals.xy + beyond * a_normals.z, a_normals.w);
#endif
}
