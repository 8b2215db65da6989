// SPDX-License-Identifier: MIT
// The refinement of a frame on the CPU: what the GPU does (shaders/subdivision), decision by decision.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "method/projector.h"
#include "methods/subdivision/subdivision.h"

namespace lodlab::subdivision {

/// What a pixel error asks of lines; a row of what the GPU searches for a number of triangles.
struct Step {
  float kappa, never, gain;
  float tau;
};
static_assert(sizeof(Step) == 16);

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

/// What a face is drawn with.
struct Refined {
  bool visible = false;
  int64_t triangles = 0, tested = 0;
  int level = 0;  ///< the least of its triangles' longest lines
};

class Refinement {
 public:
  Refinement(const Lying& lying, const Uniforms& uniforms, const Step& step)
      : lying_(lying), uniforms_(uniforms) {
    frame_ = {step.kappa, step.never, step.gain, uniforms.low_code, uniforms.metric, uniforms.d};
  }
  bool visible(size_t face) const;
  /// The triangles of a face, in the GPU's order; how many triangles were tested.
  int64_t for_triangles(size_t face, const std::function<void(const PatternTriangle&)>& visit) const;

 private:
  Corners corners(const FaceRecord& face) const;

  const Lying& lying_;
  const Uniforms& uniforms_;
  RefineFrame frame_;
};

}  // namespace lodlab::subdivision
