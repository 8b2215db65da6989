// SPDX-License-Identifier: MIT
// One bisection of a triangle: its halves go on to the next pass (stream 0), or, as fine as it should be, its corners
// leave as indices (stream 1). ROOTS: control faces out of sight end here.
#include "subdivision/walk.glsl"
#include "subdivision/slots.glsl"

layout(points) in;
layout(points, max_vertices = 2) out;

in uvec3 v_triangle[];

layout(stream = 0) out uvec3 next_triangle;
layout(stream = 1) out uvec3 fine_triangle;

void go_on(uint f, PatternTriangle t) {
  const uvec3 bits = bits_of(t);
  next_triangle = uvec3(f, bits.x | bits.y << 16, bits.z);
  EmitStreamVertex(0);
  EndStreamPrimitive(0);
}

Line side_between(RefineFrame refine, FaceRecord face, Corners at, ivec2 p, ivec2 q) {
  const int place = limit_place(refine, p, q), side = place / LODLAB_LEVELS - 1, level = place % LODLAB_LEVELS;
  LineRecord record = face.inner;
  if (side >= 0) record = edge_record(face.edge[side]);
  return line_between(refine, limit_of(refine, record, level), at, p, q);
}

void main() {
  const uint f = v_triangle[0].x;
  const FaceRecord face = face_records[f];
  const Corners at = corners_of(face);
#ifdef ROOTS
  if (!is_seen(face, at)) return;
#endif
  const RefineFrame refine = refine_frame();
  PatternTriangle t = triangle(uvec3(v_triangle[0].y, v_triangle[0].y >> 16, v_triangle[0].z));
  const int side = split_of(refine, metric_of(at), side_between(refine, face, at, t.p0, t.p1),
                            side_between(refine, face, at, t.p1, t.p2), side_between(refine, face, at, t.p2, t.p0), t);
  if (side != 0) {
    t = turned(t, side);
    if (!swaps(t)) {
      const ivec2 middle = middle_point(t);
      go_on(f, PatternTriangle(t.p2, t.p0, middle));
      go_on(f, PatternTriangle(t.p1, t.p2, middle));
      return;
    }
    t = swapped(t);
  }
  const int n = 1 << frame.d;
  fine_triangle = uvec3(position_of(f, t.p0, n), position_of(f, t.p1, n), position_of(f, t.p2, n));
  EmitStreamVertex(1);
  EndStreamPrimitive(1);
}
