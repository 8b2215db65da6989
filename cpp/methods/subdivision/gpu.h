// SPDX-License-Identifier: MIT
// A store of subdivision on the GPU: the control mesh with its records and, in slots, groups of control faces
// (pages.h): their heights, and where their points lie; and the passes of a frame (shaders/subdivision).
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "gl/buffer.h"
#include "gl/program.h"
#include "gl/vertex_array.h"
#include "methods/subdivision/feedback.h"
#include "methods/subdivision/paging.h"
#include "render/pass.h"
#include "render/surface.h"

namespace lodlab::subdivision {

/// What a frame refines by: one step, or the first of many that leaves at most so many triangles.
struct Search {
  std::vector<Step> steps;
  std::optional<uint32_t> most;
};

/// Of the steps among which a number of triangles is sought, sixteen for each power of two.
inline constexpr size_t kSteps = 512, kFirstStep = kSteps / 2;

/// Of frame.glsl.
struct FrameState {
  float eye_high[4], eye_low[4];
  Frustum frustum;
  uint32_t faces;
  int32_t metric, d;
  uint32_t low_code, everything, most, triangles, tested;
  Step step;
  uint32_t command[5], padding;
};
static_assert(sizeof(FrameState) == 184 && offsetof(FrameState, faces) == 112);

/// The slot of each group; kNowhere: it is not there, or is to be drawn as if it were not.
using Slots = std::vector<uint32_t>;
inline constexpr uint32_t kNowhere = ~0u;

class Gpu {
 public:
  /// `feedback`: by geometry shader and transform feedback, else by compute shaders.
  Gpu(const SubdivisionHierarchy& hierarchy, bool feedback, int64_t slots);
  static Room room(const SubdivisionHierarchy& hierarchy, bool feedback);

  /// Puts the heights of a group into a slot: for the next refinement.
  void put(uint32_t group, int64_t slot, const Bytes& heights, render::Submitted& submitted);
  /// Of the control mesh as it is posed; null: at rest.
  void refine(const Uniforms& uniforms, const Search& search, const std::shared_ptr<const Posed>& posed,
              const Slots& slots, render::Work& work);
  /// Of a cut by hand.
  void refine(const Uniforms& uniforms, const Records& records, const Slots& slots, render::Work& work);
  void draw(const Uniforms& uniforms, render::Pass& pass);
  int64_t bytes() const;

 private:
  /// `by_hand`: null, or records in place of the pose's.
  void lie(const std::shared_ptr<const Posed>& posed, const Records* by_hand, const Slots& slots,
           render::Submitted& submitted);
  /// Places the points from one place among positions to another.
  void displace(int64_t first, int64_t last);
  /// Refines by a step. More than `most` triangles: it may end before all are counted.
  int64_t count(FrameState& state, int64_t most, render::Work& work);
  void run(FrameState& state, render::Work& work);
  FrameState begin(const Uniforms& uniforms, render::Work& work);
  void send(const FrameState& state, render::Work& work);
  FrameState state_now() const;
  void make_room();

  const SubdivisionHierarchy& hierarchy_;
  std::shared_ptr<const Posed> posed_;  ///< as it lies on the GPU
  Slots slots_;                         ///< as they are there
  bool records_are_by_hand_ = false;
  std::vector<int64_t> put_;  ///< slots whose points are to be placed
  int64_t faces_, slot_points_, most_triangles_;
  std::shared_ptr<const render::Surface> surface_;
  gl::Program displace_, count_, refine_, place_, emit_;
  render::SurfaceProgram draw_;
  gl::Buffer control_, records_, edge_records_, vertex_heights_, points_table_;
  gl::Buffer slot_of_group_, group_of_slot_, heights_, positions_, splits_, counts_, state_, indices_;
  gl::VertexArray array_;
  std::optional<Feedback> feedback_;
  struct Kept {
    Uniforms uniforms;
    Step step;
    uint32_t most, everything;
  };
  static_assert(sizeof(Kept) == sizeof(Uniforms) + 24);  // compared byte by byte
  std::optional<Kept> kept_;                             ///< what the indices are of
  size_t from_ = kFirstStep;  ///< where the next search begins: what it finds does not depend on it
  bool uploaded_now_ = true;  ///< the next frame reports what came with the first one
};

}  // namespace lodlab::subdivision
