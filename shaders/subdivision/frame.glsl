// SPDX-License-Identifier: MIT
// What the passes of a frame share: the control mesh, records, and the state of the frame.
#include "subdivision/records.h"

struct ControlVertex {
  float position[3], normal[3];  // relative to the centre of the source's box
};
struct Step {
  float kappa, never, gain, tau;  // what a pixel error asks
};
layout(std430, binding = 3) readonly buffer Control { ControlVertex control[]; };
layout(std430, binding = 4) readonly buffer Faces { FaceRecord face_records[]; };
layout(std430, binding = 5) readonly buffer Edges { LineRecord edge_records[]; };
/// Mirrors FrameState of gpu.h.
layout(std430, binding = 6) buffer FrameState {
  vec4 eye_high, eye_low;  // relative to the centre
  Frustum frustum;
  uint faces;
  int metric, d;
  uint low_code;
  uint everything;       // faces out of sight are refined, too
  uint most;             // of the triangles that are counted: how many more does not matter
  uint triangles;        // of the pass
  uint tested;
  Step step;
  uint command[5];       // of the draw: 3 * triangles, 1, 0, 0, 0
} frame;

vec3 control_position(uint v) {
  return vec3(control[v].position[0], control[v].position[1], control[v].position[2]);
}
vec3 control_normal(uint v) { return vec3(control[v].normal[0], control[v].normal[1], control[v].normal[2]); }

vec3 from_eye(vec3 position) {
  precise vec3 relative = (position - frame.eye_high.xyz) - frame.eye_low.xyz;
  return relative;
}
