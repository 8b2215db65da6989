// SPDX-License-Identifier: MIT
#include "render/frame.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <chrono>
#include <limits>

#include "base/errors.h"
#include "gl/context.h"
#include "gl/error.h"
#include "render/gl_pass.h"
#include "render/replay.h"
#include "render/target.h"

namespace lodlab::render {
namespace {

constexpr float kBackground[4] = {0.925f, 0.945f, 0.965f, 1.0f};
constexpr float kNothing[4] = {0.0f, 0.0f, 0.0f, 0.0f};

const float* clear_color(Show show) { return show == Show::kClass ? kNothing : kBackground; }

/// Rows from bottom first to top first.
template <class T>
void flip_rows(std::vector<T>& values, int rows) {
  const size_t row = values.size() / static_cast<size_t>(rows);
  for (size_t low = 0, high = static_cast<size_t>(rows) - 1; low < high; ++low, --high) {
    std::swap_ranges(values.begin() + static_cast<ptrdiff_t>(low * row),
                     values.begin() + static_cast<ptrdiff_t>((low + 1) * row),
                     values.begin() + static_cast<ptrdiff_t>(high * row));
  }
}

Picture read_picture(const gl::Framebuffer& target, double near_plane, bool want_depth) {
  Picture picture;
  picture.width = target.width();
  picture.height = target.height();
  const size_t pixels = static_cast<size_t>(picture.width) * static_cast<size_t>(picture.height);
  picture.rgba.resize(4 * pixels);
  target.read_color(picture.rgba.data());
  flip_rows(picture.rgba, picture.height);
  if (!want_depth) return picture;
  picture.depth.resize(pixels);
  target.read_depth(picture.depth.data());
  flip_rows(picture.depth, picture.height);
  for (float& depth : picture.depth) {
    depth = depth > 0.0f ? static_cast<float>(near_plane / static_cast<double>(depth))
                         : std::numeric_limits<float>::infinity();
  }
  return picture;
}

using Clock = std::chrono::steady_clock;

double milliseconds(Clock::duration duration) {
  return std::chrono::duration<double, std::milli>(duration).count();
}

/// GL time of a scope, where the device can tell.
class GpuTimer {
 public:
  explicit GpuTimer(bool wanted) {
    if (!wanted) return;
    query_ = gl::Query(GL_TIME_ELAPSED);
    query_.begin();
    running_ = true;
  }
  ~GpuTimer() {
    if (running_) glEndQuery(GL_TIME_ELAPSED);
  }
  void stop() {
    if (running_) query_.end();
    running_ = false;
  }
  double milliseconds() const { return static_cast<double>(query_.result()) * 1e-6; }

 private:
  gl::Query query_;
  bool running_ = false;
};

/// Counts the primitives that a scope hands to the rasterizer.
class PrimitiveCounter {
 public:
  PrimitiveCounter() : query_(GL_PRIMITIVES_GENERATED) { query_.begin(); }
  ~PrimitiveCounter() {
    if (running_) glEndQuery(GL_PRIMITIVES_GENERATED);
  }
  int64_t stop() {
    running_ = false;
    query_.end();
    return static_cast<int64_t>(query_.result());
  }

 private:
  gl::Query query_;
  bool running_ = true;
};

/// What the cut needs ahead of its triangles; then the target.
const gl::Framebuffer& begin(Work& work, const DrawCall& call, int width, int height) {
  if (call.prepare) {
    reset_state();
    call.prepare(work);
    gl::check("preparing the cut");
  }
  return bind_target(width, height);
}

void submit(DrawPass& pass, const DrawCall& call) {
  call.draw(pass);
  gl::check("drawing the cut");
}

/// What transform feedback writes to: as large as the largest batch so far; never destroyed, as the context
/// is not.
gl::Buffer& capture_buffer() {
  constexpr int64_t kFirstBytes = int64_t{1} << 20;
  static auto* kept = new gl::Buffer(kFirstBytes);
  return *kept;
}

}  // namespace

Picture draw_picture(const Camera& camera, Show show, const DrawCall& call, bool want_depth,
                     bool everything) {
  DrawPass pass(camera, shader_show(show), everything);
  const gl::Framebuffer& target = begin(pass, call, camera.width, camera.height);
  clear_target(clear_color(show));
  int64_t triangles = 0;
  if (show != Show::kNone) {
    PrimitiveCounter counter;
    submit(pass, call);
    triangles = counter.stop();
  }
  Picture picture = read_picture(target, camera.near_plane, want_depth);
  picture.triangles = triangles;
  return picture;
}

Picture draw_wire(const Camera& camera, const DrawCall& call) {
  DrawPass fill(camera, kShowFill, false);
  const gl::Framebuffer& target = begin(fill, call, camera.width, camera.height);
  clear_target(kBackground);
  glEnable(GL_POLYGON_OFFSET_FILL);
  glPolygonOffset(-1.0f, -2.0f);  // away from the eye: depth is reversed
  submit(fill, call);
  glDisable(GL_POLYGON_OFFSET_FILL);
  glPolygonMode(GL_FRONT_AND_BACK, GL_LINE);
  DrawPass lines(camera, kShowLine, false);
  submit(lines, call);
  glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
  return read_picture(target, camera.near_plane, true);
}

Captured capture(const Camera& camera, const DrawCall& call, bool everything) {
  constexpr int64_t kMostBytes = INT32_MAX;
  gl::Buffer& buffer = capture_buffer();
  for (;;) {
    CapturePass pass(camera, everything, buffer);
    begin(pass, call, 16, 16);
    glEnable(GL_RASTERIZER_DISCARD);
    call.draw(pass);
    const int64_t needed = pass.finish();
    gl::check("capturing the cut");
    glDisable(GL_RASTERIZER_DISCARD);
    if (needed <= buffer.bytes()) return {camera.eye, std::move(pass.vertices())};
    if (needed > kMostBytes) {
      throw Unsupported("capture: one batch of " + std::to_string(needed) + " bytes is above the limit of " +
                        std::to_string(kMostBytes));
    }
    buffer = gl::Buffer(needed);
  }
}

Timing time_draw(const Camera& camera, Show show, const DrawCall& call) {
  const bool software = gl::ensure_context().software;
  glFinish();
  const Clock::time_point start = Clock::now();
  GpuTimer timer(!software);
  DrawPass pass(camera, shader_show(show), false);
  begin(pass, call, camera.width, camera.height);
  if (show == Show::kNone) {
    glEnable(GL_RASTERIZER_DISCARD);
  } else {
    clear_target(clear_color(show));
  }
  submit(pass, call);
  timer.stop();
  glFinish();
  Timing timing;
  timing.total_ms = milliseconds(Clock::now() - start);
  timing.gpu_clock = software ? "wall" : "query";
  timing.gpu_ms = software ? timing.total_ms : timer.milliseconds();
  glDisable(GL_RASTERIZER_DISCARD);
  pass.tell();
  timing.submitted = pass.submitted;
  return timing;
}

DrawCall redraw(std::shared_ptr<const Captured> captured, std::shared_ptr<const Surface> field) {
  return [captured, field, mesh = std::shared_ptr<StaticMesh>()](Pass& pass) mutable {
    if (mesh == nullptr) mesh = std::make_shared<StaticMesh>(captured->vertices);
    mesh->draw(pass, *field);
  };
}

Picture replay(const Captured& captured, const Camera& camera, const Surface& field, Show show) {
  StaticMesh mesh(captured.vertices);
  return draw_picture(camera, show, [&](Pass& pass) { mesh.draw(pass, field); });
}

Picture replay_depth(const Captured& captured, const Camera& camera, const Surface& field) {
  StaticMesh mesh(captured.vertices);
  const gl::Framebuffer& target = bind_target(camera.width, camera.height);
  clear_target(kBackground);
  DrawPass pass(camera, kShowLine, false);
  submit(pass, [&](Pass& into) { mesh.draw(into, field); });
  return read_picture(target, camera.near_plane, true);
}

std::shared_ptr<StaticMesh> make_static_mesh(const Captured& captured, const std::vector<uint32_t>& indices,
                                             const std::vector<uint32_t>& first_use) {
  return std::make_shared<StaticMesh>(captured.vertices, indices, first_use);
}

Timing time_static(const Camera& camera, Show show, StaticMesh& mesh, const Surface& field) {
  return time_draw(camera, show, [&](Pass& pass) { mesh.draw(pass, field); });
}

}  // namespace lodlab::render
