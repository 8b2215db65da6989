// SPDX-License-Identifier: MIT
// Where a sample of the pattern lies, written once: this file compiles as C++ and as GLSL, and gives the same bits. Sums
// and products of floats, in one order. Normals are interpolated and not made unit again: no root, and what lies
// between two heights over a face is the convex hull of six points.
#ifndef LODLAB_DISPLACE_H
#define LODLAB_DISPLACE_H

#ifdef __cplusplus
#include <glm/glm.hpp>
namespace lodlab::subdivision {
#define LODLAB_FUNCTION inline
#define LODLAB_PRECISE
using glm::vec3;
#else
#define LODLAB_FUNCTION
#define LODLAB_PRECISE precise
#endif

LODLAB_FUNCTION vec3 interpolated(vec3 a, vec3 b, vec3 c, vec3 weights) {
  LODLAB_PRECISE vec3 out_there = (weights.x * a + weights.y * b) + weights.z * c;
  return out_there;
}
LODLAB_FUNCTION vec3 displaced(vec3 base, vec3 normal, float height) {
  LODLAB_PRECISE vec3 out_there = base + height * normal;
  return out_there;
}

/// The control face's corners a, b, c and the unit normals there; weights are multiples of 1 / n, their sum is 1;
/// `height` is in lengths of the interpolated normal. A sample on an edge has its lower vertex for a, the other for
/// b, and no third weight; a vertex is a.
LODLAB_FUNCTION vec3 displaced(vec3 a, vec3 b, vec3 c, vec3 normal_a, vec3 normal_b, vec3 normal_c, vec3 weights,
                               float height) {
  return displaced(interpolated(a, b, c, weights), interpolated(normal_a, normal_b, normal_c, weights), height);
}

#ifdef __cplusplus
#undef LODLAB_FUNCTION
#undef LODLAB_PRECISE
}  // namespace lodlab::subdivision
#endif
#endif
