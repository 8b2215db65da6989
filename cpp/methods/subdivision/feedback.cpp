// SPDX-License-Identifier: MIT
#include "methods/subdivision/feedback.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <utility>

#include "gl/error.h"
#include "method/indirect.h"

namespace lodlab::subdivision {
namespace {

constexpr int64_t kTriangle = 12;  ///< bytes: a point of a pass, three indices

gl::Program program(std::vector<std::string> defines, const char* more) {
  if (*more != '\0') defines.emplace_back(more);
  return gl::Program(
      {{{GL_VERTEX_SHADER, "subdivision/refine.vert"}, {GL_GEOMETRY_SHADER, "subdivision/refine.geom"}},
       std::move(defines),
       {"next_triangle", "gl_NextBuffer", "fine_triangle"}});
}

/// Makes room for `bytes`, for no more than `most`, and keeps the first `kept`.
void grow(gl::Buffer& buffer, int64_t bytes, int64_t kept, int64_t most) {
  if (bytes <= buffer.bytes()) return;
  gl::Buffer larger(std::clamp(2 * buffer.bytes(), bytes, std::max(bytes, most)));
  if (kept > 0) glCopyNamedBufferSubData(buffer.id(), larger.id(), 0, 0, kept);
  buffer = std::move(larger);
}

}  // namespace

Feedback::Feedback(const std::vector<std::string>& defines, int64_t most_triangles)
    : most_triangles_(most_triangles),
      roots_(program(defines, "ROOTS")),
      halves_(program(defines, "")),
      to_go_(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, 0),
      fine_(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, 1),
      target_(1, 1) {
  points_.integers(0, 0, 3, GL_UNSIGNED_INT, 0);
}

Feedback::Result Feedback::run(int64_t faces, int64_t most, gl::Buffer& indices) {
  Result out{0, 0};
  target_.bind();
  glEnable(GL_RASTERIZER_DISCARD);
  int64_t to_go = faces;
  for (int from = 0; to_go > 0 && out.triangles + to_go <= std::max(most, faces); from = 1 - from) {
    const bool roots = out.tested == 0;
    out.tested += to_go;
    gl::Buffer& into = pass_[1 - from];
    reserve(into, 2 * to_go * kTriangle, 2 * most_triangles_ * kTriangle);
    grow(indices, (out.triangles + to_go) * kTriangle, out.triangles * kTriangle,
         most_triangles_ * kTriangle);
    (roots ? roots_ : halves_).use();
    if (!roots) points_.source(0, pass_[from], 0, static_cast<int>(kTriangle));
    (roots ? none_ : points_).bind();
    glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, into.id());
    glBindBufferRange(GL_TRANSFORM_FEEDBACK_BUFFER, 1, indices.id(), out.triangles * kTriangle,
                      to_go * kTriangle);
    to_go_.begin();
    fine_.begin();
    glBeginTransformFeedback(GL_POINTS);
    glDrawArrays(GL_POINTS, 0, static_cast<GLsizei>(to_go));
    glEndTransformFeedback();
    fine_.end();
    to_go_.end();
    gl::check("bisecting control faces");
    out.triangles += static_cast<int64_t>(fine_.result());
    to_go = static_cast<int64_t>(to_go_.result());
  }
  out.triangles += to_go;
  glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, 0);
  glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 1, 0);
  glMemoryBarrier(GL_ALL_BARRIER_BITS);
  glDisable(GL_RASTERIZER_DISCARD);
  return out;
}

}  // namespace lodlab::subdivision
