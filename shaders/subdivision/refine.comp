// SPDX-License-Identifier: MIT
// Bisects each control face in sight: which side of which triangle is split, two bits each, in the order in which
// triangles are tested (0: none); and how many triangles are left. COUNT: only how many.
#include "subdivision/walk.glsl"

layout(local_size_x = 64) in;

#ifndef COUNT
layout(std430, binding = 8) writeonly buffer Splits { uint splits[]; };  // WORDS a face
layout(std430, binding = 9) writeonly buffer Counts { uint counts[]; };
#endif

void main() {
  const uint f = gl_GlobalInvocationID.x;
  if (f >= frame.faces) return;
  const FaceRecord face = face_records[f];
  const Corners at = corners_of(face);
  uint left = 0u, tested = 0u;
  if (is_seen(face, at)) {
    const RefineFrame refine = refine_frame();
    const Limits limits = limits_of(refine, face);
    const Metric metric = metric_of(at);
    uvec3 stack[2 * 5 + 2];
    int top = 0;
    stack[top++] = bits_of(root());
    uint bits = 0u;
    while (top > 0) {
      PatternTriangle t = triangle(stack[--top]);
      for (;;) {
        const int side =
            split_of(refine, metric, line_between(refine, limits.of[limit_place(refine, t.p0, t.p1)], at, t.p0, t.p1),
                     line_between(refine, limits.of[limit_place(refine, t.p1, t.p2)], at, t.p1, t.p2),
                     line_between(refine, limits.of[limit_place(refine, t.p2, t.p0)], at, t.p2, t.p0), t);
#ifndef COUNT
        bits |= uint(side) << (2u * (tested & 15u));
        if ((tested & 15u) == 15u) {
          splits[f * uint(WORDS) + (tested >> 4)] = bits;
          bits = 0u;
        }
#endif
        ++tested;
        if (side == 0) break;
        t = turned(t, side);
        if (swaps(t)) break;
        const ivec2 middle = middle_point(t);
        stack[top++] = bits_of(PatternTriangle(t.p1, t.p2, middle));
        t = PatternTriangle(t.p2, t.p0, middle);
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
