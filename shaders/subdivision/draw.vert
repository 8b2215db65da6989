// SPDX-License-Identifier: MIT
// A point of a control face, where displace.comp has put it. Its level, for pictures of levels, is that of the lines
// whose middles it may be; 0 for a corner.
#include "common/surface_out.glsl"

layout(location = 0) in vec3 a_position;  // relative to the centre of the source's box

uniform vec3 eye_high, eye_low;  // the eye, relative to it
uniform uint faces;

layout(std430, binding = 9) readonly buffer Groups { uint groups[]; };  // in slots
layout(std430, binding = 11) readonly buffer Points { uint points[]; };

void main() {
  precise vec3 relative = (a_position - eye_high) - eye_low;
  const uint at = uint(gl_VertexID), corners = 3u * faces;
  uint node = at / 3u, point = 0u;
  if (at >= corners) {
    const uint place = (at - corners) / uint(POINTS);
    node = groups[place / uint(GROUP)] * uint(GROUP) + place % uint(GROUP);
    point = points[(at - corners) % uint(POINTS)];
  }
  const uint either = (point | point >> 8) & 255u;
  emit_surface(relative, vec2(0.0), node, 2u * uint(DOUBLINGS - findLSB(either | 1u << DOUBLINGS)), false);
}
