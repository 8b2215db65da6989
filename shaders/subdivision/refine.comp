// SPDX-License-Identifier: MIT
// Bisects each control face in sight: which side of which triangle is split, two bits each, in the order in which
// triangles are tested (0: none); and how many triangles are left. COUNT: only how many.
#include "subdivision/frame.glsl"

LineRecord edge_record(uint edge) { return edge_records[edge]; }

#include "subdivision/refine.h"

layout(local_size_x = 64) in;

#ifndef COUNT
layout(std430, binding = 8) writeonly buffer Splits { uint splits[]; };  // WORDS a face
layout(std430, binding = 9) writeonly buffer Counts { uint counts[]; };
#endif

struct Triangle {
  ivec2 p0, p1, p2;
};

uvec3 bits_of(Triangle t) {
  return uvec3(t.p0.x | t.p0.y << 8, t.p1.x | t.p1.y << 8, t.p2.x | t.p2.y << 8);
}
ivec2 point(uint bits) { return ivec2(bits & 255u, bits >> 8); }

void main() {
  const uint f = gl_GlobalInvocationID.x;
  if (f >= frame.faces) return;
  const FaceRecord face = face_records[f];
  const Corners at = Corners(from_eye(control_position(face.corner[0])), from_eye(control_position(face.corner[1])),
                             from_eye(control_position(face.corner[2])));
  const Corners normals =
      Corners(control_normal(face.corner[0]), control_normal(face.corner[1]), control_normal(face.corner[2]));
  uint left = 0u, tested = 0u;
  if (frame.everything != 0u || face_seen(face, at, normals, frame.frustum)) {
    const RefineFrame refine = RefineFrame(frame.step.kappa, frame.step.never, frame.step.gain, frame.low_code,
                                           frame.metric, frame.d);
    const Limits limits = limits_of(refine, face);
    const Metric metric = metric_of(at);
    const int n = 1 << frame.d;
    uvec3 stack[2 * 5 + 2];
    int top = 0;
    stack[top++] = bits_of(Triangle(ivec2(0), ivec2(n, 0), ivec2(0, n)));
    uint bits = 0u;
    while (top > 0) {
      const uvec3 next = stack[--top];
      ivec2 p = point(next.x), q = point(next.y), r = point(next.z);
      for (;;) {
        const int side = split_of(refine, metric, line_between(refine, limits.of[limit_place(refine, p, q)], at, p, q),
                                  line_between(refine, limits.of[limit_place(refine, q, r)], at, q, r),
                                  line_between(refine, limits.of[limit_place(refine, r, p)], at, r, p), p, q, r);
#ifndef COUNT
        bits |= uint(side) << (2u * (tested & 15u));
        if ((tested & 15u) == 15u) {
          splits[f * uint(WORDS) + (tested >> 4)] = bits;
          bits = 0u;
        }
#endif
        ++tested;
        if (side == 0) break;
        const ivec2 a = p, b = q, c = r;
        if (side == 2) p = b, q = c, r = a;
        if (side == 3) p = c, q = a, r = b;
        if (squared_length(q - p) == 3) break;
        const ivec2 middle = (p + q) / 2;
        stack[top++] = bits_of(Triangle(q, r, middle));
        q = p;
        p = r;
        r = middle;
      }
      ++left;
#ifdef COUNT
      if (frame.triangles > frame.most) break;  // too many already: how many more does not matter
#endif
    }
#ifndef COUNT
    if ((tested & 15u) != 0u) splits[f * uint(WORDS) + (tested >> 4)] = bits;
#endif
  }
#ifndef COUNT
  counts[f] = left;
#else
  atomicAdd(frame.triangles, left);
#endif
  atomicAdd(frame.tested, tested);
}
