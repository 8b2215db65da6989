// SPDX-License-Identifier: MIT
// A triangle of a control face as a point: the face, and its corners on the pattern. ROOTS: the control faces themselves.
#include "subdivision/frame.glsl"

#ifndef ROOTS
layout(location = 0) in uvec3 a_triangle;
#endif

out uvec3 v_triangle;  // face; corners 0 and 1, i | j << 8, 16 bits each; corner 2

void main() {
#ifdef ROOTS
  const uint n = 1u << frame.d;
  v_triangle = uvec3(gl_VertexID, n << 16, n << 8);
#else
  v_triangle = a_triangle;
#endif
}
