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

void set_default_state() {
  glDisable(GL_CULL_FACE);
  glDisable(GL_BLEND);
  glDisable(GL_DITHER);
  glDisable(GL_RASTERIZER_DISCARD);
  glDisable(GL_POLYGON_OFFSET_FILL);
  glEnable(GL_DEPTH_TEST);
  glDepthFunc(GL_GREATER);
  glDepthMask(GL_TRUE);
  glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
  gl::check("setting a pass's state");
}

/// Most recently used first; never destroyed, as the context is not.
std::vector<std::unique_ptr<gl::Framebuffer>>& targets() {
  static auto* kept = new std::vector<std::unique_ptr<gl::Framebuffer>>;
  return *kept;
}

}  // namespace

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
  set_default_state();
  return *kept.front();
}

void clear_target(const float* color) {
  const float far = 0.0f;
  glClearBufferfv(GL_COLOR, 0, color);
  glClearBufferfv(GL_DEPTH, 0, &far);
  gl::check("glClearBufferfv");
}

}  // namespace lodlab::render
