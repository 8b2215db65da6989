// SPDX-License-Identifier: MIT
// Where points lie: the corners of all control faces, then the points of faces in slots (slots.glsl), displaced.
#include "subdivision/frame.glsl"
#include "subdivision/displace.h"

layout(local_size_x = 64) in;

layout(std430, binding = 8) readonly buffer VertexHeights { float vertex_heights[]; };
layout(std430, binding = 9) readonly buffer Groups { uint groups[]; };  // in slots; NOWHERE: none
layout(std430, binding = 10) readonly buffer Heights { float heights[]; };  // in slots
layout(std430, binding = 11) readonly buffer Points { uint points[]; };  // i, j
layout(std430, binding = 12) writeonly buffer Positions { float positions[]; };

uniform uint faces, first, last;  // of positions

const uint kSteps = 1u << DOUBLINGS;

vec3 lying(uint a, uint b, uint c, vec3 weights, float height) {
  return displaced(control_position(a), control_position(b), control_position(c), control_normal(a),
                   control_normal(b), control_normal(c), weights, height);
}
vec3 vertex(uint v, float height) { return lying(v, v, v, vec3(1.0, 0.0, 0.0), height); }

vec3 point_of(uint f, uint point, float height) {
  const uint i = point & 255u, j = point >> 8, k = kSteps - i - j, n = kSteps;
  const uint corner[3] = face_records[f].corner;
  const float share = 1.0 / float(n);
  if (k == n || i == n || j == n) return vertex(corner[k == n ? 0 : i == n ? 1 : 2], height);
  if (j == 0u || k == 0u || i == 0u) {
    const uint side = j == 0u ? 0u : k == 0u ? 1u : 2u, steps = j == 0u ? i : k == 0u ? j : k;
    const uint from = corner[side], to = corner[(side + 1u) % 3u], along = from < to ? steps : n - steps;
    const float w = float(along) * share;
    const uint lower = min(from, to);
    return lying(lower, max(from, to), lower, vec3(1.0 - w, w, 0.0), height);
  }
  const vec3 weights = vec3(float(k) * share, float(i) * share, float(j) * share);
  return lying(corner[0], corner[1], corner[2], weights, height);
}

void main() {
  const uint at =
      first + gl_GlobalInvocationID.x + gl_GlobalInvocationID.y * gl_NumWorkGroups.x * gl_WorkGroupSize.x;
  if (at >= last) return;
  const uint corners = 3u * faces;
  vec3 there;
  if (at < corners) {
    const uint v = face_records[at / 3u].corner[at % 3u];
    there = vertex(v, vertex_heights[v]);
  } else {
    const uint value = at - corners, place = value / uint(POINTS), group = groups[place / uint(GROUP)];
    if (group == NOWHERE) return;
    const uint f = group * uint(GROUP) + place % uint(GROUP);
    if (f >= faces) return;
    there = point_of(f, points[value % uint(POINTS)], heights[value]);
  }
  for (int axis = 0; axis < 3; ++axis) positions[3u * at + uint(axis)] = there[axis];
}
