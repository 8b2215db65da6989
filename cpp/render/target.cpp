// SPDX-License-Identifier: MIT
#include "render/target.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "base/errors.h"
#include "gl/error.h"

namespace lodlab::render {
namespace {

constexpr size_t kKeptTargets = 4;

/// Most recently used first; never destroyed, as the context is not.
std::vector<std::unique_ptr<gl::Framebuffer>>& targets() {
  static auto* kept = new std::vector<std::unique_ptr<gl::Framebuffer>>;
  return *kept;
}

}  // namespace

void reset_state() {
  for (const GLenum off : {GL_CULL_FACE, GL_BLEND, GL_DITHER, GL_RASTERIZER_DISCARD, GL_POLYGON_OFFSET_FILL,
                           GL_SCISSOR_TEST, GL_STENCIL_TEST, GL_DEPTH_CLAMP, GL_PRIMITIVE_RESTART})
    glDisable(off);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_GREATER);
  glDepthMask(GL_TRUE);
  glDepthRange(0.0, 1.0);
  glColorMask(GL_TRUE, GL_TRUE, GL_TRUE, GL_TRUE);
  glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
  glFrontFace(GL_CCW);
  glBindTransformFeedback(GL_TRANSFORM_FEEDBACK, 0);
  gl::check("setting a pass's state");
}

const gl::Framebuffer& bind_target(int width, int height) {
  const gl::Info& info = gl::ensure_context();
  if (width > info.max_width || height > info.max_height) {
    throw InvalidInput("view: size " + std::to_string(width) + " x " + std::to_string(height) +
                       " is above this device's limit of " + std::to_string(info.max_width) + " x " +
                       std::to_string(info.max_height) + " pixels");
  }
  auto& kept = targets();
  const auto found = std::find_if(kept.begin(), kept.end(), [&](const auto& target) {
    return target->width() == width && target->height() == height;
  });
  if (found != kept.end()) {
    std::rotate(kept.begin(), found, found + 1);
  } else {
    if (kept.size() >= kKeptTargets) kept.pop_back();
    kept.insert(kept.begin(), std::make_unique<gl::Framebuffer>(width, height));
  }
  kept.front()->bind();
  reset_state();
  return *kept.front();
}

void clear_target(const float* color) {
  const float far = 0.0f;
  glClearBufferfv(GL_COLOR, 0, color);
  glClearBufferfv(GL_DEPTH, 0, &far);
  gl::check("glClearBufferfv");
}

}  // namespace lodlab::render
