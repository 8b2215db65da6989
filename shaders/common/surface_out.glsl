// SPDX-License-Identifier: MIT
// The end of every method's last geometry stage. All outputs are always written; the linker drops those
// that neither the fragment shader's variant nor transform feedback reads.
#include "common/camera.glsl"

invariant gl_Position;

out vec3 v_position;    // relative to the eye
out vec2 v_grid;        // (column, row) relative to the eye cell
flat out uint v_node;
flat out uint v_bits;   // level << 1 | filler
#ifdef LODLAB_PLANET
out float v_height;     // above the sphere, at the vertex: between vertices a triangle sags
#endif
// Places in maps (u, v, layer): the method sets them beside emit_surface().
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
  v_node = node;
  v_bits = level << 1 | uint(filler);
}
