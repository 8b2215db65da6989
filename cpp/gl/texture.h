// SPDX-License-Identifier: MIT
// Textures: render targets and arrays of layers that shaders sample.
#pragma once

#include <cstdint>

#include "gl/handle.h"

namespace lodlab::gl {

class Texture {
 public:
  Texture() = default;
  /// A 2D texture of one level (GL_RGBA8, GL_DEPTH_COMPONENT32F, ...).
  static Texture target(unsigned format, int width, int height);
  /// A 2D array texture with `levels` mip levels, trilinear, clamped to its edges.
  static Texture array(unsigned format, int width, int height, int layers, int levels);

  /// Copies RGBA8 pixels, rows from the first, into one level of one layer.
  void upload_rgba(int level, int layer, int x, int y, int width, int height, const void* pixels);
  void make_mips();
  void bind(unsigned unit) const;

  unsigned id() const { return handle_.id(); }
  int width() const { return width_; }
  int height() const { return height_; }
  explicit operator bool() const { return static_cast<bool>(handle_); }

 private:
  Texture(unsigned target, int width, int height);  ///< named, without storage

  Handle<Kind::kTexture> handle_;
  int width_ = 0, height_ = 0;
};

}  // namespace lodlab::gl
