// SPDX-License-Identifier: MIT
// The refinement of a frame on the CPU: what the GPU does (shaders/subdivision), decision by decision.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <vector>

#include "method/projector.h"
#include "methods/subdivision/subdivision.h"

namespace lodlab::subdivision {

/// What a pixel error asks of lines.
struct Step {
  float kappa, never, gain;
  float tau;
};
static_assert(sizeof(Step) == 16);

/// The first of `count` steps that fits, where those after one that fits do, too, and the last is taken for
/// one; sought from `from` on, in growing strides.
template <class Fits>
size_t first_that_fits(size_t count, size_t from, const Fits& fits) {
  size_t low = 0, high = count - 1;
  bool up = false, down = false;
  for (size_t at = from, stride = 1; low < high; stride *= 2) {
    at = std::clamp(at, low, high - 1);
    if (fits(at)) {
      high = at;
      down = true;
      at = up ? (low + high) / 2 : at - std::min(at, stride);
    } else {
      low = at + 1;
      up = true;
      at = down ? (low + high) / 2 : at + stride;
    }
  }
  return low;
}

/// All that decides a frame.
struct Uniforms {
  float eye_high[3], eye_low[3];  ///< relative to the centre of the source's box
  Frustum frustum;
  int32_t metric, d;
  uint32_t low_code;
};

Uniforms uniforms_of(const SubdivisionHierarchy& hierarchy, const Camera& camera, int metric);
Step step_of(const Projector& projector, double tau);

/// A control mesh as it lies in a frame.
struct Lying {
  const std::vector<vec3>& positions;
  const std::vector<vec3>& normals;
  const Records& records;
};

class Refinement {
 public:
  Refinement(const Lying& lying, const Uniforms& uniforms, const Step& step)
      : lying_(lying), uniforms_(uniforms) {
    frame_ = {step.kappa, step.never, step.gain, uniforms.low_code, uniforms.metric, uniforms.d};
  }
  bool visible(size_t face) const;
  /// Whether a control edge of the face would be split by records that hold nothing back, and is not.
  bool lacks(size_t face, const Records& all) const;
  /// The triangles of a face, in the GPU's order; how many triangles were tested.
  int64_t for_triangles(size_t face, const std::function<void(const PatternTriangle&)>& visit) const;

 private:
  Corners corners(const FaceRecord& face) const;

  const Lying& lying_;
  const Uniforms& uniforms_;
  RefineFrame frame_;
};

/// Of a face of which all lines below a level are split.
int64_t triangles_at_level(const Pattern& pattern, int level);

}  // namespace lodlab::subdivision
