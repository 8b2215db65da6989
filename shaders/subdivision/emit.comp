// SPDX-License-Identifier: MIT
// The triangles that refine.comp left, as indices: its splits are followed again. The last vertex of a triangle is its
// newest one.
#include "subdivision/walk.glsl"
#include "subdivision/slots.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = 8) readonly buffer Splits { uint splits[]; };
layout(std430, binding = 9) readonly buffer Counts { uint counts[]; };  // of triangles before each face
layout(std430, binding = 10) writeonly buffer Indices { uint indices[]; };

void main() {
  const uint f = gl_GlobalInvocationID.x;
  if (f >= frame.faces) return;
  uint out_there = counts[f];
  if (counts[f + 1u] == out_there) return;
  const int n = 1 << frame.d;
  uvec3 stack[2 * 5 + 2];
  int top = 0;
  stack[top++] = bits_of(root());
  uint tested = 0u, bits = 0u;
  while (top > 0) {
    PatternTriangle t = triangle(stack[--top]);
    for (;;) {
      if ((tested & 15u) == 0u) bits = splits[f * uint(WORDS) + (tested >> 4)];
      const uint side = bits >> (2u * (tested & 15u)) & 3u;
      ++tested;
      if (side == 0u) break;
      t = turned(t, int(side));
      if (swaps(t)) {
        t = swapped(t);
        break;
      }
      const ivec2 middle = middle_point(t);
      stack[top++] = bits_of(PatternTriangle(t.p1, t.p2, middle));
      t = PatternTriangle(t.p2, t.p0, middle);
    }
    indices[3u * out_there] = position_of(f, t.p0, n);
    indices[3u * out_there + 1u] = position_of(f, t.p1, n);
    indices[3u * out_there + 2u] = position_of(f, t.p2, n);
    ++out_there;
  }
}
