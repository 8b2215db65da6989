// SPDX-License-Identifier: MIT
// What decides of lines, faces and frames (refine.h): this file compiles as C++ and as GLSL. Records lie in buffers as
// they are here (std430).
#ifndef LODLAB_RECORDS_H
#define LODLAB_RECORDS_H

#ifdef __cplusplus
#include <cstdint>
#include <glm/glm.hpp>
namespace lodlab::subdivision {
using glm::vec4;
using uint = uint32_t;
#endif

/// What lines decide by.
#define LODLAB_METRIC_BOUND 0      ///< the projected bound
#define LODLAB_METRIC_LENGTH 1     ///< the paper's: projected length
#define LODLAB_METRIC_CURVATURE 2  ///< the paper's: projected length times geometric curvature
#define LODLAB_METRIC_LEVEL 3      ///< none: a cut by hand

/// What the lines of a control edge, or those inside of a face, know. Lengths are in source units.
struct LineRecord {
  uint bounds[3];  // a code of 8 bits for each level
  float scale;     // of bounds: 1, or what a deformation stretches them by
  float spread;    // largest stretch of the control face: the ball of level 0 has this radius
  float swell;     // the largest displacement, and what floats round
  float slope;     // geometric curvature by control edge length
  uint drawn;      // the level below which lines may be split; those of cuts by hand are
};

struct FaceRecord {
  uint corner[3];  // control vertices
  uint edge[3];    // from corner k to the next
  LineRecord inner;
  float low, high;    // least and largest height
  float error;        // of the finest surface: how far from it the source may be
};

/// The same for all faces of a frame.
struct RefineFrame {
  float kappa;   // a bound projects to the budget seen from so many times its own length; + 1
  float never;   // a bound no larger projects to less than the budget from anywhere
  float gain;    // the paper's metrics: squared pixels by squared budget of a length at distance 1
  uint low_code; // bits of the float that code 0 stands for
  int metric;
  int d;         // the pattern has 2^d steps a side
};

struct Frustum {
  vec4 plane[5];  // inward, of positions relative to the eye
};

#ifdef __cplusplus
}  // namespace lodlab::subdivision
#endif
#endif
