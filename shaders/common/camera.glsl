// SPDX-License-Identifier: MIT
// The camera block: one view of one source. Mirrors CameraBlock in render/camera_block.h.
layout(std140, binding = 0) uniform CameraBlock {
  mat4 clip_from_relative;  // rotation and projection only: positions are relative to the eye
  ivec2 eye_cell;           // floor of the eye's (column, row), clamped
  vec2 eye_frac;            // the eye's (column, row) less eye_cell
  vec2 spacing;             // dx, dy
  vec2 eye_z;               // the eye's height as the sum of two floats
  vec4 eye_world;           // the eye, and the planet's radius: for shading; of meshes the eye's large part
  vec3 tint;                // z_min, z_max, whether the sea has colours of its own
  float zero;               // 0, unknown to the compiler
  ivec4 cells;              // columns and rows of cells
  vec4 eye_low;             // the eye less eye_world: positions of meshes
  dvec4 planet;             // the eye and the radius, for positions on planets
} camera;

/// Clip coordinates of a position relative to the eye: one order of operations in every program, so that a
/// captured vertex drawn again lands on the same bits. Depth is near / distance.
vec4 clip_position(vec3 p) {
  const mat4 m = camera.clip_from_relative;
  precise float x = m[0].x * p.x + m[1].x * p.y + m[2].x * p.z;
  precise float y = m[0].y * p.x + m[1].y * p.y + m[2].y * p.z;
  precise float w = m[0].w * p.x + m[1].w * p.y + m[2].w * p.z;
  return vec4(x, y, m[3].z, w);
}
