// SPDX-License-Identifier: MIT
// How a control face is bisected, written once: this file compiles as C++ and as GLSL, and decides alike. Sums and
// products of floats, comparisons, no root, no division. METHOD.md has the proofs.
//
// A line is between two points (i, j) of the pattern of one face; where it lies on a control edge, it reads the edge's
// record in place of the face's, and nothing else of the face: both of the edge's faces decide alike. It wants a split
// where the eye is nearer to its middle on the control mesh than what its bound and its ball take.
//
// In GLSL `edge_record(index)` is a function declared before this file is included, in C++ an argument.
#ifndef LODLAB_REFINE_H
#define LODLAB_REFINE_H

#include "subdivision/records.h"

#ifdef __cplusplus
#include <bit>
#include <cmath>
#include <glm/glm.hpp>
namespace lodlab::subdivision {
#define LODLAB_FUNCTION inline
#define LODLAB_PRECISE
#define LODLAB_TEMPLATE template <class EdgeRecordOf>
#define LODLAB_EDGES , const EdgeRecordOf& edge_record
#define LODLAB_PASS_EDGES , edge_record
using glm::ivec2;
using glm::vec3;
using std::abs;
inline float uintBitsToFloat(uint bits) { return std::bit_cast<float>(bits); }
inline int findMSB(int value) { return static_cast<int>(std::bit_width(static_cast<uint>(value))) - 1; }
#else
#define LODLAB_FUNCTION
#define LODLAB_PRECISE precise
#define LODLAB_TEMPLATE
#define LODLAB_EDGES
#define LODLAB_PASS_EDGES
#endif

/// Corners of a face relative to the eye.
struct Corners {
  vec3 a, b, c;
};

/// A code's bound: eight steps for each power of two.
LODLAB_FUNCTION float bound_of_code(uint low_code, uint code) { return uintBitsToFloat(low_code + (code << 20)); }

LODLAB_FUNCTION uint code_of(LineRecord record, int level) {
  return (record.bounds[level >> 2] >> (8 * (level & 3))) & 255u;
}

/// Of the lattice in steps: (i, j) and (i + di, j + dj).
LODLAB_FUNCTION int squared_length(ivec2 p) { return p.x * p.x + p.x * p.y + p.y * p.y; }

/// Its place in the list of a face's points (Pattern::point).
LODLAB_FUNCTION int point_number(ivec2 p, int n) { return p.y * (n + 1) - p.y * (p.y - 1) / 2 + p.x; }

/// The control edge (0, 1, 2: from that corner) on which a line lies; -1: none.
LODLAB_FUNCTION int side_of(ivec2 p, ivec2 q, int n) {
  if (p.y == 0 && q.y == 0) return 0;
  if (p.x + p.y == n && q.x + q.y == n) return 1;
  return p.x == 0 && q.x == 0 ? 2 : -1;
}

LODLAB_FUNCTION float dotted(vec3 a, vec3 b) {
  LODLAB_PRECISE float sum = (a.x * b.x + a.y * b.y) + a.z * b.z;
  return sum;
}

/// The point with weights (k, i, j) / all of the corners. On an edge one weight is 0, and the other two terms add up
/// alike from either side.
LODLAB_FUNCTION vec3 on_control(Corners at, int k, int i, int j, float share) {
  LODLAB_PRECISE vec3 sum = (float(k) * at.a + float(i) * at.b) + float(j) * at.c;
  LODLAB_PRECISE vec3 point = sum * share;
  return point;
}

/// The middle of a line on the control mesh.
LODLAB_FUNCTION vec3 middle_of(Corners at, ivec2 p, ivec2 q, int n) {
  ivec2 sum = p + q;
  return on_control(at, 2 * n - sum.x - sum.y, sum.x, sum.y, 0.5f / float(n));
}

/// Its squared length there.
LODLAB_FUNCTION float flat_length(Corners at, ivec2 p, ivec2 q, int n) {
  float share = 1.0f / float(n);
  LODLAB_PRECISE vec3 way =
      on_control(at, n - q.x - q.y, q.x, q.y, share) - on_control(at, n - p.x - p.y, p.x, p.y, share);
  return dotted(way, way);
}

/// Of a line in the family of bisections, lattice steps times a power of 2 or those times sqrt(3); -1: of no such line.
LODLAB_FUNCTION int family_level(int squared, int d) {
  int top = findMSB(squared);
  if (squared == (1 << top) && (top & 1) == 0) return 2 * d - top;
  return squared == (3 << (top - 1)) && (top & 1) == 1 ? 2 * d - top : -1;
}

/// The radius of a line's ball, of that of a control edge: each holds those of what lies below it, and the triangles
/// of which it is the longest line.
LODLAB_FUNCTION float ball_of(int level) {
  return (level & 1) == 0 ? uintBitsToFloat(uint(127 - (level >> 1)) << 23)
                          : 0.75f * uintBitsToFloat(uint(127 - (level >> 1)) << 23);
}

LODLAB_FUNCTION bool record_wants(RefineFrame frame, LineRecord record, Corners at, ivec2 p, ivec2 q) {
  int n = 1 << frame.d, level = family_level(squared_length(q - p), frame.d);
  if (frame.metric == LODLAB_METRIC_LEVEL) return level >= 0 && level < int(record.drawn);
  vec3 middle = middle_of(at, p, q, n);
  if (frame.metric == LODLAB_METRIC_BOUND) {
    if (level < 0) return false;
    LODLAB_PRECISE float bound = bound_of_code(frame.low_code, code_of(record, level)) * record.scale;
    if (!(bound > frame.never)) return false;
    // What is above outlives what is below by more than floats round.
    float widened = 1.0f + 1e-5f * float(2 * frame.d + 1 - level);
    LODLAB_PRECISE float ball = record.spread * ball_of(level) + record.swell;
    LODLAB_PRECISE float reach = (frame.kappa * bound + ball) * widened;
    LODLAB_PRECISE float squared = reach * reach;
    return dotted(middle, middle) < squared;
  }
  LODLAB_PRECISE float seen = frame.gain * flat_length(at, p, q, n);
  if (frame.metric == LODLAB_METRIC_CURVATURE) {
    LODLAB_PRECISE float curved = seen * (record.slope * record.slope);
    seen = curved;
  }
  return seen > dotted(middle, middle);
}

LODLAB_TEMPLATE LODLAB_FUNCTION bool line_wants(RefineFrame frame, FaceRecord face, Corners at, ivec2 p,
                                                ivec2 q LODLAB_EDGES) {
  int side = side_of(p, q, 1 << frame.d);
  if (side < 0) return record_wants(frame, face.inner, at, p, q);
  return record_wants(frame, edge_record(face.edge[side]), at, p, q);
}

/// Whether a line is longer on the screen than another one.
LODLAB_FUNCTION bool seen_longer(Corners at, ivec2 p, ivec2 q, ivec2 r, ivec2 s, int n) {
  vec3 here = middle_of(at, p, q, n), there = middle_of(at, r, s, n);
  LODLAB_PRECISE float one = flat_length(at, p, q, n) * dotted(there, there);
  LODLAB_PRECISE float other = flat_length(at, r, s, n) * dotted(here, here);
  return one > other;
}

/// Which side of a triangle between three points is split: 1 to 3 from its corner 0 to 2; 0: none. Of those that want it,
/// the longest on the pattern, of equals the longest on the screen. A side without a point in its middle, of the finest
/// triangles (1, 1, sqrt(3)), stands for its swap with the other diagonal.
LODLAB_TEMPLATE LODLAB_FUNCTION int split_of(RefineFrame frame, FaceRecord face, Corners at, ivec2 p0, ivec2 p1,
                                             ivec2 p2 LODLAB_EDGES) {
  ivec2 point[3];
  point[0] = p0;
  point[1] = p1;
  point[2] = p2;
  int squared[3];
  for (int k = 0; k < 3; ++k) squared[k] = squared_length(point[(k + 1) % 3] - point[k]);
  int best = 0, longest = 0;
  for (int k = 0; k < 3; ++k) {
    ivec2 p = point[k], q = point[(k + 1) % 3], way = q - p;
    if (squared[k] < longest || squared[k] == 1) continue;
    bool swap = squared[k] == 3 && squared[(k + 1) % 3] == 1 && squared[(k + 2) % 3] == 1;
    swap = swap && (frame.metric == LODLAB_METRIC_BOUND || frame.metric == LODLAB_METRIC_LEVEL);
    if (((way.x | way.y) & 1) != 0 && !swap) continue;
    if (!line_wants(frame, face, at, p, q LODLAB_PASS_EDGES)) continue;
    if (squared[k] == longest &&
        !seen_longer(at, p, q, point[best - 1], point[best % 3], 1 << frame.d))
      continue;
    best = k + 1;
    longest = squared[k];
  }
  return best;
}

LODLAB_FUNCTION bool before(ivec2 a, ivec2 b) { return a.y < b.y || (a.y == b.y && a.x < b.x); }

struct PatternTriangle {
  ivec2 p0, p1, p2;
};

/// The triangle in place of (p, q, r) where its side p q is swapped: of both triangles on p q one takes the end that
/// comes first.
LODLAB_FUNCTION PatternTriangle swapped(ivec2 p, ivec2 q, ivec2 r) {
  ivec2 across = p + q - r;
  bool first = before(r, across) == before(p, q);
  PatternTriangle out_there;
  out_there.p0 = first ? p : across;
  out_there.p1 = first ? across : q;
  out_there.p2 = r;
  return out_there;
}

LODLAB_FUNCTION vec3 raised(vec3 point, vec3 normal, float height) {
  LODLAB_PRECISE vec3 there = point + height * normal;
  return there;
}

LODLAB_FUNCTION bool beyond(vec4 plane, vec3 p, float error) {
  LODLAB_PRECISE float rounding = 1e-5f * ((abs(p.x) + abs(p.y)) + abs(p.z));
  LODLAB_PRECISE float inside = ((dotted(vec3(plane.x, plane.y, plane.z), p) + plane.w) + error) + rounding;
  return inside < 0.0f;
}

/// Whether the prism over a face, with these corners and normals there, may be seen: false only if it lies outside of
/// one plane of the frustum, with all that the source may be off.
LODLAB_FUNCTION bool face_seen(FaceRecord face, Corners at, Corners normals, Frustum frustum) {
  vec3 point[6];
  point[0] = raised(at.a, normals.a, face.low);
  point[1] = raised(at.b, normals.b, face.low);
  point[2] = raised(at.c, normals.c, face.low);
  point[3] = raised(at.a, normals.a, face.high);
  point[4] = raised(at.b, normals.b, face.high);
  point[5] = raised(at.c, normals.c, face.high);
  for (int i = 0; i < 5; ++i) {
    bool outside = true;
    for (int k = 0; k < 6; ++k) outside = outside && beyond(frustum.plane[i], point[k], face.error);
    if (outside) return false;
  }
  return true;
}

#ifdef __cplusplus
#undef LODLAB_FUNCTION
#undef LODLAB_PRECISE
#undef LODLAB_TEMPLATE
#undef LODLAB_EDGES
#undef LODLAB_PASS_EDGES
}  // namespace lodlab::subdivision
#endif
#endif
