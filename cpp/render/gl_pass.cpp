// SPDX-License-Identifier: MIT
#include "render/gl_pass.h"

#include <epoxy/gl.h>

#include <algorithm>

#include "gl/error.h"
#include "render/camera_block.h"

namespace lodlab::render {

DrawPass::DrawPass(const Camera& camera, int show, bool everything)
    : Pass(camera, everything), show_(show), block_(sizeof(CameraBlock)) {}

unsigned DrawPass::bind(SurfaceProgram& program, const Surface& field, Maps maps, bool feedback) {
  // Level colours and wire pictures show the triangles: theirs are the normals there.
  const bool shades = show_ == shader_show(Show::kShade), normals = show_ == shader_show(Show::kNormal);
  // The class picture is drawn with voids filled: a hole that relief hides in one picture and a lower ridge
  // shows in the other is no crack.
  const bool holes = field.has_coverage() && show_ != shader_show(Show::kClass);
  const Variant variant{
      show_, field.kind(), holes, {maps.colors && shades, maps.normals && (shades || normals)}, feedback};
  const unsigned name = program_of(program, variant);
  const CameraBlock block = field.block(camera_);
  block_.upload(0, std::as_bytes(std::span(&block, 1)));
  glUseProgram(name);
  glBindBufferBase(GL_UNIFORM_BUFFER, 0, block_.id());
  gl::check("binding a surface program");
  field.bind();
  return name;
}

unsigned DrawPass::use(SurfaceProgram& program, const Surface& field, Maps maps) {
  return bind(program, field, maps, false);
}

CapturePass::CapturePass(const Camera& camera, bool everything, const gl::Buffer& buffer)
    : DrawPass(camera, shader_show(Show::kShade), everything),
      buffer_(buffer),
      generated_(GL_PRIMITIVES_GENERATED) {}

CapturePass::~CapturePass() {
  if (!running_) return;
  glEndTransformFeedback();
  glEndQuery(GL_PRIMITIVES_GENERATED);
}

unsigned CapturePass::use(SurfaceProgram& program, const Surface& field, Maps maps) {
  finish();
  const unsigned name = bind(program, field, maps, true);
  glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, buffer_.id());
  generated_.begin();
  glBeginTransformFeedback(GL_TRIANGLES);
  gl::check("glBeginTransformFeedback");
  running_ = true;
  return name;
}

int64_t CapturePass::finish() {
  if (!running_) return needed_;
  running_ = false;
  glEndTransformFeedback();
  generated_.end();
  gl::check("glEndTransformFeedback");
  const size_t count = 3 * static_cast<size_t>(generated_.result());
  const int64_t bytes = static_cast<int64_t>(count * sizeof(CapturedVertex));
  needed_ = std::max(needed_, bytes);
  if (bytes > buffer_.bytes() || needed_ > buffer_.bytes()) return needed_;
  const size_t before = vertices_.size();
  vertices_.resize(before + count);
  buffer_.read(0, std::as_writable_bytes(std::span(vertices_).subspan(before)));
  return needed_;
}

}  // namespace lodlab::render
