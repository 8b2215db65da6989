// SPDX-License-Identifier: MIT
// Where the points of all faces lie, face by face: heights as they are packed (methods/subdivision/bits.h), displaced.
#include "subdivision/frame.glsl"
#include "subdivision/displace.h"

layout(local_size_x = 64) in;

layout(std430, binding = 8) readonly buffer VertexHeights { float vertex_heights[]; };
layout(std430, binding = 9) readonly buffer Ranges { vec2 ranges[]; };
layout(std430, binding = 10) readonly buffer Words { uint words[]; };
layout(std430, binding = 11) readonly buffer Points { uint points[]; };  // i, j, and the place inside of a face
layout(std430, binding = 12) writeonly buffer Positions { float positions[]; };

uniform uint faces, edges;

const uint kSteps = 1u << DOUBLINGS, kOnEdge = kSteps - 1u, kInside = (kSteps - 1u) * (kSteps - 2u) / 2u;

float height_at(uint block, uint value) {
  const uint bit = value * uint(BITS), word = bit >> 5, shift = bit & 31u;
#if BITS == 32
  return uintBitsToFloat(words[value]);
#else
  uint q = words[word] >> shift;
  if (shift + uint(BITS) > 32u) q |= words[word + 1u] << (32u - shift);
  q &= (1u << BITS) - 1u;
  precise float height = ranges[block].x + ranges[block].y * float(q);
  return height;
#endif
}

vec3 lying(uint a, uint b, uint c, vec3 weights, float height) {
  return displaced(control_position(a), control_position(b), control_position(c), control_normal(a),
                   control_normal(b), control_normal(c), weights, height);
}

void main() {
  const uint at = gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x;
  const uint f = at / uint(POINTS), point = points[at % uint(POINTS)];
  if (f >= faces) return;
  const uint i = point & 255u, j = point >> 8 & 255u, k = kSteps - i - j, n = kSteps;
  const uint corner[3] = face_records[f].corner;
  const float share = 1.0 / float(n);
  vec3 there;
  if (k == n || i == n || j == n) {
    const uint v = corner[k == n ? 0 : i == n ? 1 : 2];
    there = lying(v, v, v, vec3(1.0, 0.0, 0.0), vertex_heights[v]);
  } else if (j == 0u || k == 0u || i == 0u) {
    const uint side = j == 0u ? 0u : k == 0u ? 1u : 2u, steps = j == 0u ? i : k == 0u ? j : k;
    const uint from = corner[side], to = corner[(side + 1u) % 3u], along = from < to ? steps : n - steps;
    const uint edge = face_records[f].edge[side];
    const float w = float(along) * share;
    const uint lower = min(from, to);
    there = lying(lower, max(from, to), lower, vec3(1.0 - w, w, 0.0), height_at(edge, edge * kOnEdge + along - 1u));
  } else {
    const vec3 weights = vec3(float(k) * share, float(i) * share, float(j) * share);
    const uint value = edges * kOnEdge + f * kInside + (point >> 16);
    there = lying(corner[0], corner[1], corner[2], weights, height_at(edges + f, value));
  }
  for (int axis = 0; axis < 3; ++axis) positions[3u * at + uint(axis)] = there[axis];
}
