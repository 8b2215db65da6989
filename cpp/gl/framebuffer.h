// SPDX-License-Identifier: MIT
// An offscreen target: RGBA8 colour and 32-bit float depth.
#pragma once

#include "gl/handle.h"
#include "gl/texture.h"

namespace lodlab::gl {

class Framebuffer {
 public:
  Framebuffer() = default;
  Framebuffer(int width, int height);

  void bind() const;
  /// Copies width x height RGBA8 pixels, or float depths, bottom row first.
  void read_color(void* pixels) const;
  void read_depth(void* depths) const;

  int width() const { return color_.width(); }
  int height() const { return color_.height(); }

 private:
  Handle<Kind::kFramebuffer> handle_;
  Texture color_, depth_;
};

}  // namespace lodlab::gl
