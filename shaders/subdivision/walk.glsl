// SPDX-License-Identifier: MIT
// What the passes that bisect control faces share: a face as it lies in the frame, and points in few bits.
#include "subdivision/frame.glsl"

LineRecord edge_record(uint edge) { return edge_records[edge]; }

#include "subdivision/refine.h"

Corners corners_of(FaceRecord face) {
  return Corners(from_eye(control_position(face.corner[0])), from_eye(control_position(face.corner[1])),
                 from_eye(control_position(face.corner[2])));
}

/// Whether a face is refined.
bool is_seen(FaceRecord face, Corners at) {
  const Corners normals =
      Corners(control_normal(face.corner[0]), control_normal(face.corner[1]), control_normal(face.corner[2]));
  return frame.everything != 0u || face_seen(face, at, normals, frame.frustum);
}

RefineFrame refine_frame() {
  return RefineFrame(frame.step.kappa, frame.step.never, frame.step.gain, frame.low_code, frame.metric, frame.d);
}

/// The whole face.
PatternTriangle root() {
  const int n = 1 << frame.d;
  return PatternTriangle(ivec2(0), ivec2(n, 0), ivec2(0, n));
}

uint bits_of(ivec2 p) { return uint(p.x | p.y << 8); }
ivec2 point(uint bits) { return ivec2(bits & 255u, bits >> 8 & 255u); }
uvec3 bits_of(PatternTriangle t) { return uvec3(bits_of(t.p0), bits_of(t.p1), bits_of(t.p2)); }
PatternTriangle triangle(uvec3 bits) { return PatternTriangle(point(bits.x), point(bits.y), point(bits.z)); }
