// SPDX-License-Identifier: MIT
// A vertex of a node's grid, stitched to coarser neighbours. Its height, on a planet its position on the lattice
// (lattice.h), comes as an attribute; only a vertex that stitching moves looks up another one. Which vertex it is
// follows from its place in the tile (grids.h).
#include "common/position.glsl"
#include "common/surface_out.glsl"

#ifdef LODLAB_PLANET
#define Vertex ivec4
uniform ivec3 u_eye_cell;  // the eye on the lattice
uniform vec3 u_eye_rest;   // what it is beyond that cell, source units
uniform vec2 u_lattice;    // a cell, a step: powers of two

/// Differences of cells are exact, and so are products.
vec3 relative_position(ivec2 col_row, Vertex at) {
  ivec3 steps = ivec3(at.w, at.w >> 10, at.w >> 20) & 1023;
  precise vec3 relative = vec3(at.xyz - u_eye_cell) * u_lattice.x + (vec3(steps) * u_lattice.y - u_eye_rest);
  return relative;
}
#else
#define Vertex float
vec3 relative_position(ivec2 col_row, Vertex at) { return surface_position(col_row, at); }
#endif

layout(location = 0) in Vertex a_vertex;
layout(location = 1) in ivec4 a_place;  // first column and row; index of its vertex; rows of the tile
layout(location = 2) in uvec2 a_tag;    // node; level << 16 | log2 of its side << 8 | log2 of its stride
// In the node's tile of a map: u and v of its first sample; from one sample to the next; layer.
#ifdef LODLAB_COLORS
layout(location = 3) in vec4 a_colors;
#endif
#ifdef LODLAB_NORMALS
layout(location = 4) in vec4 a_normals;
#endif

layout(std430, binding = 3) readonly buffer Vertices { Vertex vertices[]; };
layout(std430, binding = 4) readonly buffer Strides { uint strides[]; };  // a byte a block

uniform ivec2 u_last;    // column and row
uniform int u_fringe;    // at least 0: the row whose samples, from column 0 on, are the vertices (grids.h)
uniform ivec4 u_blocks;  // blocks a row; log2 of their side; 1: columns wrap; poles

int stride_of(int block_x, int block_y) {
  int block = block_y * u_blocks.x + block_x;
  return int(strides[block >> 2] >> ((block & 3) << 3) & 255u);
}

#include "multigrain/stitch.h"

const int kPitch = 17;  // heights a row of a strip: 16 cells

void main() {
  int vertex = gl_VertexID - a_place.z;
  int line = int((float(vertex) + 0.5) * (1.0 / float(kPitch)));  // exact: vertices of a tile are few
  int strip = int((float(line) + 0.5) / float(a_place.w));
  int i = vertex - line * kPitch + (strip << 4), j = line - strip * a_place.w;

  StitchNode node = StitchNode(a_place.x, a_place.y, int(a_tag.y >> 8 & 255u), int(a_tag.y & 255u));
  StitchField field = StitchField(u_last.x, u_last.y, u_blocks.x, u_blocks.y, u_blocks.z, u_blocks.w);
  StitchVertex at = u_fringe < 0 ? stitch(node, i, j, field) : StitchVertex(gl_VertexID, u_fringe);
  int a = node.stride_log2, up = (1 << a) - 1;  // a clamped vertex is the tile's last
  int to_i = (at.col - node.col + up) >> a, to_j = (at.row - node.row + up) >> a;
  Vertex own = a_vertex;
  if (u_fringe < 0 && (to_i != i || to_j != j)) {
    int to_strip = (max(to_i, 1) - 1) >> 4;  // the last column of one rather than the first of the next
    own = vertices[a_place.z + (to_strip * a_place.w + to_j) * kPitch + to_i - (to_strip << 4)];
  }
  ivec2 cell = ivec2(at.col, at.row);
  emit_surface(relative_position(cell, own), surface_grid(cell), a_tag.x, a_tag.y >> 16, false);
#ifdef LODLAB_COLORS
  v_colors = vec3(a_colors.xy + vec2(cell - a_place.xy) * a_colors.z, a_colors.w);
#endif
#ifdef LODLAB_NORMALS
  v_normals = vec3(a_normals.xy + vec2(cell - a_place.xy) * a_normals.z, a_normals.w);
#endif
}
