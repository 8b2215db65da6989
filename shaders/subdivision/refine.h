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
using glm::ivec2;
using glm::vec3;
using std::abs;
inline float uintBitsToFloat(uint bits) { return std::bit_cast<float>(bits); }
inline int floatBitsToInt(float value) { return std::bit_cast<int>(value); }
#else
#define LODLAB_FUNCTION
#define LODLAB_PRECISE precise
#define LODLAB_TEMPLATE
#define LODLAB_EDGES
#endif

#define LODLAB_LEVELS 11  // of the largest pattern, 2^5 steps a side

/// Corners of a face relative to the eye.
struct Corners {
  vec3 a, b, c;
};

struct PatternTriangle {
  ivec2 p0, p1, p2;
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
  int bits = floatBitsToInt(float(squared)), top = (bits >> 23) - 127, rest = bits & 0x7fffff;
  return rest == ((top & 1) == 0 ? 0 : 0x400000) ? 2 * d - top : -1;
}

/// The radius of a line's ball, of that of a control edge: each holds those of what lies below it, and the triangles
/// of which it is the longest line.
LODLAB_FUNCTION float ball_of(int level) {
  float even = uintBitsToFloat(uint(127 - (level >> 1)) << 23);
  return (level & 1) == 0 ? even : 0.75f * even;
}

/// Lines of a level whose middle is nearer to the eye, squared, want a split; by the paper's metrics those whose squared
/// length is larger than their middle's squared distance by this factor.
LODLAB_FUNCTION float limit_of(RefineFrame frame, LineRecord record, int level) {
  if (level >= int(record.drawn)) return -1.0f;
  if (frame.metric == LODLAB_METRIC_LEVEL) return 3e38f;
  if (frame.metric == LODLAB_METRIC_LENGTH) return frame.gain;
  if (frame.metric == LODLAB_METRIC_CURVATURE) {
    LODLAB_PRECISE float curved = frame.gain * (record.slope * record.slope);
    return curved;
  }
  LODLAB_PRECISE float bound = bound_of_code(frame.low_code, code_of(record, level)) * record.scale;
  // What is above outlives what is below by more than floats round.
  float widened = 1.0f + 1e-5f * float(2 * frame.d + 1 - level);
  LODLAB_PRECISE float ball = record.spread * ball_of(level) + record.swell;
  LODLAB_PRECISE float reach = (frame.kappa * bound + ball) * widened;
  LODLAB_PRECISE float squared = reach * reach;
  return bound > frame.never ? squared : -1.0f;
}

/// Limits of a face's own lines, then of those on its edges 0 to 2: a row of LODLAB_LEVELS each.
struct Limits {
  float of[4 * LODLAB_LEVELS];
};

LODLAB_TEMPLATE LODLAB_FUNCTION Limits limits_of(RefineFrame frame, FaceRecord face LODLAB_EDGES) {
  Limits limits;
  for (int side = 0; side < 3; ++side) {
    LineRecord record = edge_record(face.edge[side]);
    for (int level = 0; level <= 2 * frame.d; ++level)
      limits.of[(side + 1) * LODLAB_LEVELS + level] = limit_of(frame, record, level);
  }
  for (int level = 0; level <= 2 * frame.d; ++level) limits.of[level] = limit_of(frame, face.inner, level);
  return limits;
}

/// The metric of a control face: squared lengths of lines on it.
struct Metric {
  float uu, uv, vv;
};

LODLAB_FUNCTION Metric metric_of(Corners at) {
  vec3 u = at.b - at.a, v = at.c - at.a;
  Metric metric;
  metric.uu = dotted(u, u);
  metric.uv = dotted(u, v);
  metric.vv = dotted(v, v);
  return metric;
}

LODLAB_FUNCTION float squared_by(Metric metric, ivec2 way) {
  LODLAB_PRECISE float sum = (float(way.x * way.x) * metric.uu + float(2 * way.x * way.y) * metric.uv) +
                             float(way.y * way.y) * metric.vv;
  return sum;
}

/// Where the limit of a line is among a face's.
LODLAB_FUNCTION int limit_place(RefineFrame frame, ivec2 p, ivec2 q) {
  int level = family_level(squared_length(q - p), frame.d);
  return (side_of(p, q, 1 << frame.d) + 1) * LODLAB_LEVELS + (level < 0 ? 0 : level);
}

struct Line {
  bool wants;   // a split, where there is a point in its middle
  float far;    // squared distance of the middle
  int squared;  // length on the pattern
};

LODLAB_FUNCTION Line line_between(RefineFrame frame, float limit, Corners at, ivec2 p, ivec2 q) {
  int n = 1 << frame.d;
  Line line;
  line.squared = squared_length(q - p);
  vec3 middle = middle_of(at, p, q, n);
  line.far = dotted(middle, middle);
  if (frame.metric == LODLAB_METRIC_LENGTH || frame.metric == LODLAB_METRIC_CURVATURE) {
    LODLAB_PRECISE float seen = limit * flat_length(at, p, q, n);
    line.wants = seen > line.far;
  } else {
    line.wants = line.far < limit && family_level(line.squared, frame.d) >= 0;
  }
  return line;
}

/// Whether a side is split before another one that wants it, too: the longer on the pattern, of equals on the screen.
LODLAB_FUNCTION bool first_of(Line line, ivec2 way, Line other, ivec2 other_way, Metric metric) {
  LODLAB_PRECISE float seen = squared_by(metric, way) * other.far;
  LODLAB_PRECISE float other_seen = squared_by(metric, other_way) * line.far;
  return line.squared > other.squared || (line.squared == other.squared && seen > other_seen);
}

LODLAB_FUNCTION bool halvable(ivec2 way) { return ((way.x | way.y) & 1) == 0; }

/// Which of three sides of a triangle is split: 1 to 3 from its corner 0 to 2; 0: none. Of those that want it, the longest
/// on the pattern, of equals the longest on the screen. A side without a point in its middle, of the finest triangles
/// (1, 1, sqrt(3)), stands for its swap with the other diagonal.
LODLAB_FUNCTION int split_of(RefineFrame frame, Metric metric, Line first, Line second, Line third,
                             PatternTriangle t) {
  ivec2 p0 = t.p0, p1 = t.p1, p2 = t.p2;
  bool may_swap = (frame.metric == LODLAB_METRIC_BOUND || frame.metric == LODLAB_METRIC_LEVEL) &&
               first.squared + second.squared + third.squared == 5;
  first.wants = first.wants && (halvable(p1 - p0) || (may_swap && first.squared == 3));
  second.wants = second.wants && (halvable(p2 - p1) || (may_swap && second.squared == 3));
  third.wants = third.wants && (halvable(p0 - p2) || (may_swap && third.squared == 3));
  int best = first.wants ? 1 : 0;
  if (second.wants && (best == 0 || first_of(second, p2 - p1, first, p1 - p0, metric))) best = 2;
  bool over_best = best == 1 ? first_of(third, p0 - p2, first, p1 - p0, metric)
                             : first_of(third, p0 - p2, second, p2 - p1, metric);
  return third.wants && (best == 0 || over_best) ? 3 : best;
}

/// A triangle from the corner on where the side (1 to 3) that is split begins.
LODLAB_FUNCTION PatternTriangle turned(PatternTriangle t, int side) {
  PatternTriangle out_there;
  out_there.p0 = side == 1 ? t.p0 : side == 2 ? t.p1 : t.p2;
  out_there.p1 = side == 1 ? t.p1 : side == 2 ? t.p2 : t.p0;
  out_there.p2 = side == 1 ? t.p2 : side == 2 ? t.p0 : t.p1;
  return out_there;
}

/// Whether the first side of a turned triangle has no point in its middle: it is swapped, not halved.
LODLAB_FUNCTION bool swaps(PatternTriangle t) { return squared_length(t.p1 - t.p0) == 3; }

LODLAB_FUNCTION ivec2 middle_point(PatternTriangle t) { return (t.p0 + t.p1) / 2; }

LODLAB_FUNCTION bool before(ivec2 a, ivec2 b) { return a.y < b.y || (a.y == b.y && a.x < b.x); }

/// The triangle in place of one whose first side is swapped: of both triangles on that side one takes the end that comes
/// first.
LODLAB_FUNCTION PatternTriangle swapped(PatternTriangle t) {
  ivec2 across = t.p0 + t.p1 - t.p2;
  bool first = before(t.p2, across) == before(t.p0, t.p1);
  PatternTriangle out_there;
  out_there.p0 = first ? t.p0 : across;
  out_there.p1 = first ? across : t.p1;
  out_there.p2 = t.p2;
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
}  // namespace lodlab::subdivision
#endif
#endif
