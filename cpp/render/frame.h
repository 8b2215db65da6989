// SPDX-License-Identifier: MIT
// Frames: what a draw call leaves in an offscreen target, and what transform feedback captures of it.
// Everything here runs on the thread that owns the GL context.
#pragma once

#include <concepts>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "geometry/view.h"
#include "render/pass.h"

namespace lodlab::render {

/// How a cut is drawn (Session::prepare and draw, bound to it).
struct DrawCall {
  std::function<void(Work&)> prepare;  ///< passes of its own, in neutral state; may be empty
  std::function<void(Pass&)> draw;     ///< the triangles

  DrawCall() = default;
  DrawCall(std::function<void(Work&)> before, std::function<void(Pass&)> triangles)
      : prepare(std::move(before)), draw(std::move(triangles)) {}
  template <std::invocable<Pass&> Draw>
  DrawCall(Draw triangles) : draw(std::move(triangles)) {}
  explicit operator bool() const { return static_cast<bool>(draw); }
};

/// Row 0 is the top row. Depth is the distance along the view axis, infinity where nothing was drawn.
struct Picture {
  int width = 0, height = 0;
  std::vector<uint8_t> rgba;
  std::vector<float> depth;
  int64_t triangles = 0;  ///< drawn, as the GPU counts them
};

/// One vertex as the GPU emitted it: 28 bytes, the transform feedback layout.
struct CapturedVertex {
  float x, y, z;   ///< relative to the eye, source units
  float col, row;  ///< grid coordinates relative to the eye cell
  uint32_t node;
  uint32_t bits;  ///< level << 1 | filler
};
static_assert(sizeof(CapturedVertex) == 28);

/// Three vertices a triangle; a triangle is filler when any of its vertices says so.
struct Captured {
  glm::dvec3 eye{0.0};
  std::vector<CapturedVertex> vertices;
  std::vector<glm::dvec3> given =
      {};  ///< of triangles that no GPU emitted: every vertex as given; else empty
  int64_t triangles() const { return static_cast<int64_t>(vertices.size() / 3); }
};

/// Draws into an offscreen target of the camera's size and reads colour (and depth, if wanted) back.
Picture draw_picture(const Camera& camera, Show show, const DrawCall& call, bool want_depth = true,
                     bool everything = false);

/// The same with lines of every triangle over a pale surface.
Picture draw_wire(const Camera& camera, const DrawCall& call);

/// The triangles that the very program which draws emits; the buffer grows until nothing is lost.
Captured capture(const Camera& camera, const DrawCall& call, bool everything);

/// Draws captured triangles from a plain buffer with the same fragment shader and clip computation; the
/// buffer is made when first drawn.
DrawCall redraw(std::shared_ptr<const Captured> captured, std::shared_ptr<const Surface> field);
Picture replay(const Captured& captured, const Camera& camera, const Surface& field, Show show);

/// The same depth, in one colour: a third less time on a software device, where nothing is interpolated.
Picture replay_depth(const Captured& captured, const Camera& camera, const Surface& field);

struct Timing {
  double gpu_ms = 0.0;    ///< of both parts: GL_TIME_ELAPSED, or wall time to glFinish on the software device
  double total_ms = 0.0;  ///< wall time from the first GL call to glFinish
  std::string gpu_clock;  ///< "query" or "wall"
  Submitted submitted;
};

/// Draws once without reading anything back. Show::kNone turns the rasterizer off.
Timing time_draw(const Camera& camera, Show show, const DrawCall& call);

/// The benchmark's reference: one static buffer holding these triangles with equal positions (indexed,
/// 32-bit indices, meshoptimizer's vertex cache and fetch order, done by the caller), drawn with one call
/// and the same shading.
class StaticMesh;
std::shared_ptr<StaticMesh> make_static_mesh(const Captured& captured, const std::vector<uint32_t>& indices,
                                             const std::vector<uint32_t>& first_use);
Timing time_static(const Camera& camera, Show show, StaticMesh& mesh, const Surface& field);

}  // namespace lodlab::render
