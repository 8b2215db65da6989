// SPDX-License-Identifier: MIT
// Draws captured triangles from a plain buffer: the instrument's replay, and the benchmark's static mesh.
// Inputs that the variant does not need are dropped by the linker.
#include "common/surface_out.glsl"

layout(location = 0) in vec3 position;  // relative to the eye
layout(location = 1) in vec2 grid;
layout(location = 2) in uint node;
layout(location = 3) in uint bits;

void main() { emit_surface(position, grid, node, bits >> 1, (bits & 1u) != 0u); }
