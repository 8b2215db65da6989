// SPDX-License-Identifier: MIT
// How a vertex shader's inputs are read from buffers.
#pragma once

#include <cstdint>

#include "gl/buffer.h"
#include "gl/handle.h"

namespace lodlab::gl {

class VertexArray {
 public:
  VertexArray();

  /// Input `location` reads `count` components of `type` at `offset` of each `stride` bytes of the buffer
  /// bound to slot `binding`: as floats (integers are converted, not normalized), or as integers.
  void floats(unsigned location, unsigned binding, int count, unsigned type, unsigned offset);
  void integers(unsigned location, unsigned binding, int count, unsigned type, unsigned offset);
  void source(unsigned binding, const Buffer& buffer, int64_t offset, int stride);
  void indices(const Buffer& buffer);
  void bind() const;

  unsigned id() const { return handle_.id(); }

 private:
  Handle<Kind::kVertexArray> handle_;
};

}  // namespace lodlab::gl
