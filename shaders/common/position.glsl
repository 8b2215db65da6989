// SPDX-License-Identifier: MIT
// Positions of height field samples, a function of (column, row), height and eye alone, never of the node
// that draws: two nodes round a shared vertex alike. Flat fields use floats only: integer index minus eye
// cell is exact. Planets use double tables of cosine and sine, and one cast to float.
#include "common/camera.glsl"

#ifdef LODLAB_PLANET
layout(std430, binding = 1) readonly buffer ColumnTable { dvec2 lon_cos_sin[]; };
layout(std430, binding = 2) readonly buffer RowTable { dvec2 lat_cos_sin[]; };
#endif

/// (column, row) relative to the eye cell, for emit_surface(). Columns of a planet that wraps run from 0 to
/// its number of columns, both included.
vec2 surface_grid(ivec2 col_row) { return vec2(col_row - camera.eye_cell); }

/// Position relative to the eye.
vec3 surface_position(ivec2 col_row, float height) {
#ifdef LODLAB_PLANET
  const dvec2 lon = lon_cos_sin[col_row.x], lat = lat_cos_sin[col_row.y];
  precise dvec3 direction = dvec3(lat.x * lon.x, lat.x * lon.y, lat.y);
  precise dvec3 relative = (camera.planet.w + double(height)) * direction - camera.planet.xyz;
  precise vec3 position = vec3(relative) + camera.zero;  // a pole has no -0 beside 0; a literal 0 is folded away
  return position;
#else
  precise vec2 across = (surface_grid(col_row) - camera.eye_frac) * camera.spacing;
  precise float up = (height - camera.eye_z.x) - camera.eye_z.y;
  return vec3(across.x, -across.y, up);
#endif
}
