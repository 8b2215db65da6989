// SPDX-License-Identifier: MIT
// One bisection of a triangle: its halves go on to the next pass (stream 0), or, as fine as it should be, its corners
// leave as indices (stream 1). ROOTS: control faces out of sight end here.
#include "subdivision/frame.glsl"

LineRecord edge_record(uint edge) { return edge_records[edge]; }

#include "subdivision/refine.h"
#include "subdivision/slots.glsl"

layout(points) in;
layout(points, max_vertices = 2) out;

in uvec3 v_triangle[];

layout(stream = 0) out uvec3 next_triangle;
layout(stream = 1) out uvec3 fine_triangle;

ivec2 point(uint bits) { return ivec2(bits & 255u, bits >> 8 & 255u); }
uint bits_of(ivec2 p) { return uint(p.x | p.y << 8); }

void go_on(uint f, ivec2 p, ivec2 q, ivec2 r) {
  next_triangle = uvec3(f, bits_of(p) | bits_of(q) << 16, bits_of(r));
  EmitStreamVertex(0);
  EndStreamPrimitive(0);
}

Line side_between(RefineFrame refine, FaceRecord face, Corners at, ivec2 p, ivec2 q) {
  const int place = limit_place(refine, p, q), side = place / LODLAB_LEVELS - 1, level = place % LODLAB_LEVELS;
  LineRecord record = face.inner;
  if (side >= 0) record = edge_records[face.edge[side]];
  return line_between(refine, limit_of(refine, record, level), at, p, q);
}

void main() {
  const uint f = v_triangle[0].x;
  const FaceRecord face = face_records[f];
  const Corners at = Corners(from_eye(control_position(face.corner[0])), from_eye(control_position(face.corner[1])),
                             from_eye(control_position(face.corner[2])));
#ifdef ROOTS
  const Corners normals =
      Corners(control_normal(face.corner[0]), control_normal(face.corner[1]), control_normal(face.corner[2]));
  if (frame.everything == 0u && !face_seen(face, at, normals, frame.frustum)) return;
#endif
  const RefineFrame refine =
      RefineFrame(frame.step.kappa, frame.step.never, frame.step.gain, frame.low_code, frame.metric, frame.d);
  ivec2 p = point(v_triangle[0].y), q = point(v_triangle[0].y >> 16), r = point(v_triangle[0].z);
  const int side = split_of(refine, metric_of(at), side_between(refine, face, at, p, q),
                            side_between(refine, face, at, q, r), side_between(refine, face, at, r, p), p, q, r);
  if (side != 0) {
    const ivec2 a = p, b = q, c = r;
    if (side == 2) p = b, q = c, r = a;
    if (side == 3) p = c, q = a, r = b;
    if (squared_length(q - p) != 3) {
      const ivec2 middle = (p + q) / 2;
      go_on(f, r, p, middle);
      go_on(f, q, r, middle);
      return;
    }
    const PatternTriangle other = swapped(p, q, r);
    p = other.p0;
    q = other.p1;
    r = other.p2;
  }
  const int n = 1 << frame.d;
  fine_triangle = uvec3(position_of(f, p, n), position_of(f, q, n), position_of(f, r, n));
  EmitStreamVertex(1);
  EndStreamPrimitive(1);
}
