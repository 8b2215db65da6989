// SPDX-License-Identifier: MIT
// A vertex of a node's grid, stitched to coarser neighbours: its sample's height out of the node's tile.
#include "common/position.glsl"
#include "common/surface_out.glsl"

layout(location = 0) in uvec2 a_vertex;  // (i, j)
layout(location = 1) in ivec4 a_place;   // first column and row; its height's index; heights a row of the tile
layout(location = 2) in uvec2 a_tag;     // node; level << 16 | log2 of its side << 8 | log2 of its stride

layout(std430, binding = 3) readonly buffer Heights { float heights[]; };
layout(std430, binding = 4) readonly buffer Strides { uint strides[]; };  // a byte a block

uniform ivec2 u_last;    // column and row
uniform ivec4 u_blocks;  // blocks a row; log2 of their side; 1: columns wrap; poles

int stride_of(int block_x, int block_y) {
  int block = block_y * u_blocks.x + block_x;
  return int(strides[block >> 2] >> ((block & 3) << 3) & 255u);
}

#include "multigrain/stitch.h"

void main() {
  StitchNode node = StitchNode(a_place.x, a_place.y, int(a_tag.y >> 8 & 255u), int(a_tag.y & 255u));
  StitchField field = StitchField(u_last.x, u_last.y, u_blocks.x, u_blocks.y, u_blocks.z, u_blocks.w);
  StitchVertex at = stitch(node, int(a_vertex.x), int(a_vertex.y), field);
  int a = node.stride_log2, up = (1 << a) - 1;  // a clamped vertex is the tile's last
  float height = heights[a_place.z + ((at.row - node.row + up) >> a) * a_place.w + ((at.col - node.col + up) >> a)];
  ivec2 cell = ivec2(at.col, at.row);
  emit_surface(surface_position(cell, height), surface_grid(cell), a_tag.x, a_tag.y >> 16, false);
}
