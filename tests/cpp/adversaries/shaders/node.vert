// SPDX-License-Identifier: MIT
// A vertex of the adversaries' family: a sample's (column, row), a height, and what it says that it is.
#include "common/position.glsl"
#include "common/surface_out.glsl"

layout(location = 0) in uvec2 col_row;
layout(location = 1) in float height;
layout(location = 2) in uvec2 tag;  // node, filler

void main() {
  const ivec2 cell = ivec2(col_row);
  emit_surface(surface_position(cell, height), surface_grid(cell), tag.x, 0u, tag.y != 0u);
}
