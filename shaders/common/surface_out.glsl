// SPDX-License-Identifier: MIT
// The end of every method's last geometry stage. All outputs are always written; the linker drops those
// that neither the fragment shader's variant nor transform feedback reads.
#include "common/camera.glsl"

invariant gl_Position;

out vec3 v_position;    // relative to the eye
out vec2 v_grid;        // (column, row) relative to the eye cell
flat out uint v_bits;   // level << 1 | filler
#ifdef LODLAB_PLANET
out float v_height;     // above the sphere, at the vertex: between vertices a triangle sags
#endif
#ifdef LODLAB_FEEDBACK  // CapturedVertex in two outputs: software devices copy output by output
flat out uvec4 v_captured_start;  // position, column
flat out uvec3 v_captured_end;    // row, node, bits
#endif
// Places in maps (u, v, layer), of meshes colours themselves: the method sets them beside emit_surface().
#ifdef LODLAB_COLORS
out vec3 v_colors;
#endif
#ifdef LODLAB_NORMALS
out vec3 v_normals;
#endif

void emit_surface(vec3 relative, vec2 grid, uint node, uint level, bool filler) {
  gl_Position = clip_position(relative);
  v_position = relative;
#ifdef LODLAB_PLANET
  precise vec3 from_centre = relative + camera.eye_world.xyz;
  precise float squared = dot(from_centre, from_centre);
  v_height = sqrt(squared) - camera.eye_world.w;
#endif
  v_grid = grid;
  v_bits = level << 1 | uint(filler);
#ifdef LODLAB_FEEDBACK
  v_captured_start = floatBitsToUint(vec4(relative, grid.x));
  v_captured_end = uvec3(floatBitsToUint(grid.y), node, v_bits);
#endif
}
