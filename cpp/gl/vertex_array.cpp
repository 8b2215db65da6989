// SPDX-License-Identifier: MIT
#include "gl/vertex_array.h"

#include <epoxy/gl.h>

#include "gl/error.h"

namespace lodlab::gl {

VertexArray::VertexArray() {
  ensure_context();
  unsigned name = 0;
  glCreateVertexArrays(1, &name);
  handle_ = Handle<Kind::kVertexArray>(name);
  check("glCreateVertexArrays");
}

void VertexArray::floats(unsigned location, unsigned binding, int count, unsigned type, unsigned offset) {
  glEnableVertexArrayAttrib(id(), location);
  glVertexArrayAttribFormat(id(), location, count, type, GL_FALSE, offset);
  glVertexArrayAttribBinding(id(), location, binding);
  check("glVertexArrayAttribFormat");
}

void VertexArray::integers(unsigned location, unsigned binding, int count, unsigned type, unsigned offset) {
  glEnableVertexArrayAttrib(id(), location);
  glVertexArrayAttribIFormat(id(), location, count, type, offset);
  glVertexArrayAttribBinding(id(), location, binding);
  check("glVertexArrayAttribIFormat");
}

void VertexArray::source(unsigned binding, const Buffer& buffer, int64_t offset, int stride) {
  glVertexArrayVertexBuffer(id(), binding, buffer.id(), static_cast<GLintptr>(offset), stride);
  check("glVertexArrayVertexBuffer");
}

void VertexArray::indices(const Buffer& buffer) {
  glVertexArrayElementBuffer(id(), buffer.id());
  check("glVertexArrayElementBuffer");
}

void VertexArray::bind() const {
  glBindVertexArray(id());
  check("glBindVertexArray");
}

}  // namespace lodlab::gl
