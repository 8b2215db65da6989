// SPDX-License-Identifier: MIT
// A store of subdivision on the GPU: the control mesh with its records, packed heights, where all points lie,
// and the passes of a frame (shaders/subdivision).
#pragma once

#include <optional>
#include <vector>

#include "gl/buffer.h"
#include "gl/program.h"
#include "gl/vertex_array.h"
#include "methods/subdivision/feedback.h"
#include "methods/subdivision/refine.h"
#include "render/pass.h"
#include "render/surface.h"

namespace lodlab::subdivision {

/// What a frame refines by: one step, or the first of many that leaves at most so many triangles.
struct Search {
  std::vector<Step> steps;
  std::optional<uint32_t> most;
};

/// Of frame.glsl.
struct FrameState {
  float eye_high[4], eye_low[4];
  Frustum frustum;
  uint32_t faces;
  int32_t metric, d;
  uint32_t low_code, everything, most, low, high, triangles, tested;
  uint32_t command[5], padding;
};
static_assert(sizeof(FrameState) == 176);

class Gpu {
 public:
  /// `feedback`: by geometry shader and transform feedback, else by compute shaders.
  Gpu(const SubdivisionHierarchy& hierarchy, bool feedback);

  void refine(const Uniforms& uniforms, const Search& search, render::Work& work);
  /// Of a cut by hand.
  void refine(const Uniforms& uniforms, const Records& records, render::Work& work);
  void draw(const Uniforms& uniforms, render::Pass& pass);
  int64_t bytes() const;

 private:
  void displace();
  void run(const Uniforms& uniforms, const Search& search, const gl::Buffer& faces, const gl::Buffer& edges,
           render::Work& work);
  void run_compute(bool search, render::Work& work);
  void run_feedback(FrameState& state, const Search& search, render::Work& work);
  void make_room();

  int64_t faces_, points_, words_, most_triangles_;
  std::shared_ptr<const render::Surface> surface_;
  gl::Program displace_, count_, search_, refine_, place_, emit_;
  render::SurfaceProgram draw_;
  gl::Buffer control_, records_, edge_records_, heights_, ranges_, packed_, points_table_;
  gl::Buffer positions_, splits_, counts_, state_, steps_, indices_;
  gl::VertexArray array_;
  std::optional<Feedback> feedback_;
  bool uploaded_now_ = true;  ///< the next frame reports the upload
};

}  // namespace lodlab::subdivision
