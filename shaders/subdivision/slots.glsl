// SPDX-License-Identifier: MIT
// Where points lie among positions: the corners of all control faces, then slots, each of a group of faces.
layout(std430, binding = 11) readonly buffer Slots { uint slots[]; };  // a group's; NOWHERE: it is not there

/// Of a face that is not there only corners.
uint position_of(uint face, ivec2 p, int n) {
  const uint slot = slots[face / uint(GROUP)];
  if (slot == NOWHERE) return 3u * face + (p.x == n ? 1u : p.y == n ? 2u : 0u);
  return 3u * frame.faces + (slot * uint(GROUP) + face % uint(GROUP)) * uint(POINTS) + uint(point_number(p, n));
}
