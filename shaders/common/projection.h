// SPDX-License-Identifier: MIT
// Projected error and its inverse, written once: this file compiles as C++ and as GLSL.
// K pixels per unit at distance 1, D distance from the eye to the nearest point of the node's bounds,
// n near plane, s = sqrt(1 + tan^2(hfov/2) + tan^2(vfov/2)).
//
// paper: equation 1 of Ulrich 2002. Right at the centre of the viewport only.
// strict: a visible point at distance d has depth z >= max(n, d / s); a displacement of length delta moves
//   its image by at most K delta |p| / (z (z - delta)), and the path ends where it meets the near plane.
// vertical: a displacement along the local up moves the image by K h / z^2 per unit, h the point's
//   horizontal distance from the eye: strict times the cosine of the elevation at which the node is seen.
#ifndef LODLAB_PROJECTION_H
#define LODLAB_PROJECTION_H

#ifdef __cplusplus
#include <algorithm>
#include <cmath>
namespace lodlab {
#define LODLAB_REAL double
#define LODLAB_FUNCTION inline double
using std::max;
using std::sqrt;
#else
#ifndef LODLAB_REAL
#define LODLAB_REAL float  // a selection that has a twin on the CPU defines it as double
#endif
#define LODLAB_FUNCTION LODLAB_REAL
#endif

LODLAB_FUNCTION project_paper(LODLAB_REAL delta, LODLAB_REAL K, LODLAB_REAL D, LODLAB_REAL n) {
  return delta * K / max(D, n);
}

/// The largest delta that project_paper maps to at most tau pixels.
LODLAB_FUNCTION inverse_paper(LODLAB_REAL tau, LODLAB_REAL K, LODLAB_REAL D, LODLAB_REAL n) {
  return tau * max(D, n) / K;
}

/// `cosine` is 1 for strict, elevation_cosine() for vertical.
LODLAB_FUNCTION project_strict(LODLAB_REAL delta, LODLAB_REAL K, LODLAB_REAL D, LODLAB_REAL n, LODLAB_REAL s,
                               LODLAB_REAL cosine) {
  return K * delta * s * cosine / max(n, max(n, D / s) - delta);
}

/// The largest delta that project_strict maps to at most tau pixels.
LODLAB_FUNCTION inverse_strict(LODLAB_REAL tau, LODLAB_REAL K, LODLAB_REAL D, LODLAB_REAL n, LODLAB_REAL s,
                               LODLAB_REAL cosine) {
  LODLAB_REAL z = max(n, D / s);
  LODLAB_REAL gain = K * s * cosine;
  LODLAB_REAL far_delta = tau * z / (gain + tau);
  return z - far_delta >= n ? far_delta : tau * n / gain;
}

/// Largest cosine of the elevation over a box: farthest horizontal distance, nearest vertical distance.
LODLAB_FUNCTION elevation_cosine(LODLAB_REAL horizontal, LODLAB_REAL vertical) {
  LODLAB_REAL length = sqrt(horizontal * horizontal + vertical * vertical);
  return length > 0 ? horizontal / length : 1;
}

#ifdef __cplusplus
#undef LODLAB_REAL
#undef LODLAB_FUNCTION
}  // namespace lodlab
#endif
#endif
