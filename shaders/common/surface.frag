// SPDX-License-Identifier: MIT
// The one fragment shader: every method's pictures differ by geometry alone. LODLAB_SHOW selects what is
// shown (render/variant.h). Light falls on the normals of the drawn triangles, from derivatives of the position, or on
// those of a map (geometry/normals.h); which side of a triangle is seen is always its own matter.
#include "common/camera.glsl"
#include "common/palette.glsl"

#define SHOW_SHADE 0
#define SHOW_NORMAL 1
#define SHOW_LEVEL 2
#define SHOW_CLASS 3
#define SHOW_FILL 5
#define SHOW_LINE 6

#if LODLAB_SHOW != SHOW_LINE
in vec3 v_position;
#endif
#ifdef LODLAB_PLANET
in float v_height;
#endif
#if LODLAB_SHOW == SHOW_LEVEL || LODLAB_SHOW == SHOW_FILL
flat in uint v_bits;
#endif
#ifdef LODLAB_COVERAGE
in vec2 v_grid;
layout(std430, binding = 0) readonly buffer Coverage { uint covered_bits[]; };

bool covered() {
  const ivec2 cell = clamp(ivec2(floor(v_grid)) + camera.eye_cell, ivec2(0), camera.cells.xy - 1);
  const uint bit = uint(cell.y) * uint(camera.cells.x) + uint(cell.x);
  return (covered_bits[bit >> 5] >> (bit & 31u) & 1u) != 0u;
}
#endif
#ifdef LODLAB_COLORS
in vec3 v_colors;
#ifndef LODLAB_MESH
layout(binding = 0) uniform sampler2DArray color_map;
#endif
#endif
#ifdef LODLAB_NORMALS
in vec3 v_normals;
layout(binding = 1) uniform sampler2DArray normal_map;
#endif

layout(location = 0) out vec4 color;
#if LODLAB_SHOW == SHOW_CLASS
layout(depth_less) out float gl_FragDepth;
#endif

#if LODLAB_SHOW != SHOW_LINE
/// Normal of the drawn triangle's plane, towards the eye. Both derivatives lie in the plane, so that its
/// direction holds even where the rasterizer's grid of 1/256 pixel turned a tiny triangle round; the side is
/// taken from the eye. Scaled by the distance first: no product of differences underflows.
vec3 facing_normal() {
  const vec3 a = dFdx(v_position) * gl_FragCoord.w, b = dFdy(v_position) * gl_FragCoord.w;
  const vec3 across = cross(a, b) * (dot(cross(a, b), v_position) > 0.0 ? -1.0 : 1.0);
  return across * inversesqrt(max(dot(across, across), 1e-36));
}

#ifdef LODLAB_MESH
/// A mesh has no up: its outside is the winding's.
bool seen_from_outside(vec3 normal) { return gl_FrontFacing; }

vec3 shading_normal(vec3 drawn) { return drawn; }

/// Share of the light from the camera's upper left, with a good deal from everywhere: no side is black.
float shading_light(vec3 normal) {
  const mat4 m = camera.clip_from_relative;
  const vec3 right = normalize(vec3(m[0].x, m[1].x, m[2].x)), up = normalize(vec3(m[0].y, m[1].y, m[2].y));
  const vec3 back = -normalize(vec3(m[0].w, m[1].w, m[2].w));
  const vec3 light = 0.8 * back + 0.5 * up - 0.33 * right;
  return 0.35 + 0.65 * max(dot(normal, light), 0.0);
}

vec3 surface_color() {
#ifdef LODLAB_COLORS
  return v_colors;
#else
  return kClayColor;
#endif
}
#else
vec3 local_up() {
#ifdef LODLAB_PLANET
  return normalize(v_position + camera.eye_world.xyz);
#else
  return vec3(0.0, 0.0, 1.0);
#endif
}

bool vertical(vec3 normal) { return abs(dot(normal, local_up())) < 1e-3; }

/// Whether the eye is on the outside of the triangle: above it. Vertical triangles (skirts) have no above:
/// there the rasterizer's own answer must do.
bool seen_from_outside(vec3 normal) {
  return vertical(normal) ? gl_FrontFacing : dot(normal, local_up()) > 0.0;
}

/// The normal that shades. A skirt fills a crack of a pixel or less: it is lit like level ground, or it would show
/// as dark dots.
vec3 shading_normal(vec3 drawn) {
#ifdef LODLAB_NORMALS
  const vec3 mapped = texture(normal_map, v_normals).rgb * (255.0 / 127.0) - 1.0;
  return mapped * inversesqrt(max(dot(mapped, mapped), 1e-12));
#else
  return vertical(drawn) ? local_up() : drawn;
#endif
}

/// Share of the sun's light: north-west, 45 degrees high, with a little ambient; 1 on level ground.
float shading_light(vec3 normal) {
#ifdef LODLAB_PLANET
  const vec3 up = local_up();
  const vec3 east = normalize(vec3(-up.y, up.x, 0.0) + vec3(1e-12, 0.0, 0.0));
  const vec3 sun = 0.5 * (cross(up, east) - east) + 0.70710678 * up;
#else
  const vec3 sun = vec3(-0.5, 0.5, 0.70710678);
#endif
  return 0.28 + 0.72 * 1.41421356 * max(dot(normal, sun), 0.0);
}

/// Of the surface above its datum, as its vertices have it: a coarse triangle of a planet sags below the sphere
/// by kilometres and less than a pixel, and would be coloured as sea.
float height() {
#ifdef LODLAB_PLANET
  return v_height;
#else
  return v_position.z + camera.eye_world.z;
#endif
}

vec3 surface_color() {
#ifdef LODLAB_COLORS
  return texture(color_map, v_colors).rgb;
#else
  return height_tint(height(), camera.tint);
#endif
}
#endif
#endif

vec3 shown() {
#if LODLAB_SHOW == SHOW_LINE
  return kLineColor;
#else
  const vec3 normal = facing_normal();
#if LODLAB_SHOW == SHOW_CLASS
  return vec3(seen_from_outside(normal) ? 1.0 : 128.0 / 255.0, 0.0, 0.0);
#elif LODLAB_SHOW == SHOW_NORMAL
#ifdef LODLAB_NORMALS
  return 0.5 + 0.5 * shading_normal(normal);
#else
  return 0.5 + 0.5 * normal;
#endif
#else
  const float light = shading_light(shading_normal(normal));
  if (!seen_from_outside(normal)) return kInsideColor * (0.7 + 0.3 * min(light, 1.0));
#if LODLAB_SHOW == SHOW_LEVEL
  return level_color(v_bits >> 1) * (0.45 + 0.55 * min(light, 1.15));
#elif LODLAB_SHOW == SHOW_FILL
  return mix(vec3(1.0), level_color(v_bits >> 1), 0.3) * (0.6 + 0.4 * min(light, 1.0));
#else
  return surface_color() * min(light, 1.2);
#endif
#endif
#endif
}

void main() {
#ifdef LODLAB_COVERAGE
  if (!covered()) discard;
#endif
#if LODLAB_SHOW == SHOW_CLASS
  // Along a silhouette the near and the far slope share an edge, and the rasterizer's grid of 1/256 pixel lets
  // the far one win now and then, where nothing is cracked. So inside yields to outside within 1/32 pixel.
  const float slack = fwidth(gl_FragCoord.z) / 32.0 + gl_FragCoord.z * 1e-6;
  gl_FragDepth = seen_from_outside(facing_normal()) ? gl_FragCoord.z : gl_FragCoord.z - slack;
#endif
  color = vec4(shown(), 1.0);
}
