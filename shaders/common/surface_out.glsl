// SPDX-License-Identifier: MIT
// The end of every method's last geometry stage. All outputs are always written; the linker drops those
// that neither the fragment shader's variant nor transform feedback reads.
#include "common/camera.glsl"

invariant gl_Position;

out vec3 v_position;    // relative to the eye
out vec2 v_grid;        // (column, row) relative to the eye cell
flat out uint v_node;
flat out uint v_bits;   // level << 1 | filler
#ifdef LODLAB_ATTRIBUTE
out vec3 v_attribute;   // u, v, layer: the method sets it beside emit_surface()
#endif

void emit_surface(vec3 relative, vec2 grid, uint node, uint level, bool filler) {
  gl_Position = clip_position(relative);
  v_position = relative;
  v_grid = grid;
  v_node = node;
  v_bits = level << 1 | uint(filler);
}
