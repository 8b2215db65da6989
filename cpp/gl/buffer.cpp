// SPDX-License-Identifier: MIT
#include "gl/buffer.h"

#include <epoxy/gl.h>

#include <algorithm>

#include "gl/error.h"

namespace lodlab::gl {

Buffer::Buffer(int64_t bytes, const void* data) : bytes_(bytes) {
  ensure_context();
  unsigned name = 0;
  glCreateBuffers(1, &name);
  handle_ = Handle<Kind::kBuffer>(name);
  // GL refuses empty storage; it reads as many bytes as it is told to store.
  glNamedBufferStorage(name, static_cast<GLsizeiptr>(std::max<int64_t>(bytes, 1)),
                       bytes == 0 ? nullptr : data, GL_DYNAMIC_STORAGE_BIT);
  check("glNamedBufferStorage");
}

void Buffer::upload(int64_t offset, std::span<const std::byte> bytes) {
  glNamedBufferSubData(id(), static_cast<GLintptr>(offset), static_cast<GLsizeiptr>(bytes.size()),
                       bytes.data());
  check("glNamedBufferSubData");
}

void Buffer::read(int64_t offset, std::span<std::byte> bytes) const {
  glGetNamedBufferSubData(id(), static_cast<GLintptr>(offset), static_cast<GLsizeiptr>(bytes.size()),
                          bytes.data());
  check("glGetNamedBufferSubData");
}

}  // namespace lodlab::gl
