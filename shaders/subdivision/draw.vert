// SPDX-License-Identifier: MIT
// A point of a control face, where displace.comp has put it. Its level, for pictures of levels, is that of the lines
// whose middles it may be.
#include "common/surface_out.glsl"

layout(location = 0) in vec3 a_position;  // relative to the centre of the source's box

uniform vec3 eye_high, eye_low;  // the eye, relative to it

layout(std430, binding = 11) readonly buffer Points { uint points[]; };

void main() {
  precise vec3 relative = (a_position - eye_high) - eye_low;
  const uint node = uint(gl_VertexID) / uint(POINTS), point = points[uint(gl_VertexID) % uint(POINTS)];
  const uint either = (point | point >> 8) & 255u;
  emit_surface(relative, vec2(0.0), node, 2u * uint(DOUBLINGS - findLSB(either | 1u << DOUBLINGS)), false);
}
