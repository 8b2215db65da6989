// SPDX-License-Identifier: MIT
// Colours. Levels: the colour-blind safe set of Okabe and Ito, without its black. Heights: greens through
// sand and brown to snow, blues below the sea.
const vec3 kInsideColor = vec3(0.86, 0.08, 0.52);
const vec3 kClayColor = vec3(0.80, 0.74, 0.68);
const vec3 kLineColor = vec3(0.13, 0.16, 0.22);

const vec3 kLevelColors[7] = vec3[7](vec3(0.90, 0.62, 0.00), vec3(0.34, 0.71, 0.91), vec3(0.00, 0.62, 0.45),
                                     vec3(0.94, 0.89, 0.26), vec3(0.00, 0.45, 0.70), vec3(0.84, 0.37, 0.00),
                                     vec3(0.80, 0.47, 0.65));

vec3 level_color(uint level) { return kLevelColors[level % 7u]; }

/// Colour `t` of the way from a to b to c to d to e, t from 0 to 1.
vec3 ramp(float t, vec3 a, vec3 b, vec3 c, vec3 d, vec3 e) {
  const float s = clamp(t, 0.0, 1.0) * 4.0;
  vec3 color = mix(a, b, min(s, 1.0));
  color = mix(color, c, clamp(s - 1.0, 0.0, 1.0));
  color = mix(color, d, clamp(s - 2.0, 0.0, 1.0));
  return mix(color, e, clamp(s - 3.0, 0.0, 1.0));
}

vec3 land_tint(float t) {
  return ramp(t, vec3(0.40, 0.58, 0.38), vec3(0.68, 0.75, 0.49), vec3(0.87, 0.79, 0.57), vec3(0.69, 0.53, 0.40),
              vec3(0.95, 0.94, 0.93));
}

vec3 sea_tint(float t) {
  return ramp(t, vec3(0.66, 0.83, 0.90), vec3(0.43, 0.68, 0.83), vec3(0.27, 0.52, 0.74), vec3(0.17, 0.37, 0.61),
              vec3(0.10, 0.23, 0.43));
}

/// Tint of a height; `range` is lowest, highest, and 1 where heights below 0 are sea floor. Most land lies
/// low: with a sea, land colours go by the square root.
vec3 height_tint(float z, vec3 range) {
  if (range.z != 0.0) {
    return z < 0.0 ? sea_tint(z / range.x) : land_tint(sqrt(z / range.y));
  }
  return land_tint((z - range.x) / (range.y - range.x));
}
