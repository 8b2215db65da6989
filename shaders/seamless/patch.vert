// SPDX-License-Identifier: MIT
// A lattice point of a patch. Its height comes as an attribute, from the patch's slot; which point it is follows
// from its number there (slots.h).
#include "common/position.glsl"
#include "common/surface_out.glsl"

layout(location = 0) in float a_height;
layout(location = 1) in ivec3 a_place;  // first column and row; number of the slot's first height
layout(location = 2) in uvec2 a_tag;    // node; level << 8 | log2 of the stride of its lattice

uniform ivec2 u_last;     // column and row
uniform ivec2 u_lattice;  // heights a row; segments of an edge

void main() {
  int number = gl_VertexID - a_place.z, pitch = u_lattice.x, coarser = 0;
#ifdef LODLAB_AVERAGE
  for (; number >= pitch * pitch; ++coarser) {  // a lattice for each resolution, the finest first
    number -= pitch * pitch;
    pitch = (pitch >> 1) + 1;
  }
#endif
  int v = int((float(number) + 0.5) / float(pitch));  // exact: a slot has few heights
  ivec2 at = ivec2(number - v * pitch, v) << coarser;
  ivec2 cell = min(a_place.xy + (at << int(a_tag.y & 255u)), u_last);
  uint level = a_tag.y >> 8;
#ifdef LODLAB_PARTS
  // The last vertex of a strip's triangle lies on a diagonal, where a tile has none (ranges.h).
  level = at.x == at.y || at.x + at.y == u_lattice.y ? 5u : 3u;
#endif
  emit_surface(surface_position(cell, a_height), surface_grid(cell), a_tag.x, level, false);
}
