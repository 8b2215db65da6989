// SPDX-License-Identifier: MIT
// The triangles that refine.comp left, as indices: its splits are followed again. The last vertex of a triangle is its
// newest one.
#include "subdivision/frame.glsl"

LineRecord edge_record(uint edge) { return edge_records[edge]; }

#include "subdivision/refine.h"
#include "subdivision/slots.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = 8) readonly buffer Splits { uint splits[]; };
layout(std430, binding = 9) readonly buffer Counts { uint counts[]; };  // of triangles before each face
layout(std430, binding = 10) writeonly buffer Indices { uint indices[]; };

ivec2 point(uint bits) { return ivec2(bits & 255u, bits >> 8); }
uint bits_of(ivec2 p) { return uint(p.x | p.y << 8); }

void main() {
  const uint f = gl_GlobalInvocationID.x;
  if (f >= frame.faces) return;
  uint out_there = counts[f];
  if (counts[f + 1u] == out_there) return;
  const int n = 1 << frame.d;
  uvec3 stack[2 * 5 + 2];
  int top = 0;
  stack[top++] = uvec3(bits_of(ivec2(0)), bits_of(ivec2(n, 0)), bits_of(ivec2(0, n)));
  uint tested = 0u, bits = 0u;
  while (top > 0) {
    const uvec3 next = stack[--top];
    ivec2 p = point(next.x), q = point(next.y), r = point(next.z);
    for (;;) {
      if ((tested & 15u) == 0u) bits = splits[f * uint(WORDS) + (tested >> 4)];
      const uint side = bits >> (2u * (tested & 15u)) & 3u;
      ++tested;
      if (side == 0u) break;
      const ivec2 a = p, b = q, c = r;
      if (side == 2u) p = b, q = c, r = a;
      if (side == 3u) p = c, q = a, r = b;
      if (squared_length(q - p) == 3) {
        const PatternTriangle other = swapped(p, q, r);
        p = other.p0;
        q = other.p1;
        r = other.p2;
        break;
      }
      const ivec2 middle = (p + q) / 2;
      stack[top++] = uvec3(bits_of(q), bits_of(r), bits_of(middle));
      q = p;
      p = r;
      r = middle;
    }
    indices[3u * out_there] = position_of(f, p, n);
    indices[3u * out_there + 1u] = position_of(f, q, n);
    indices[3u * out_there + 2u] = position_of(f, r, n);
    ++out_there;
  }
}
