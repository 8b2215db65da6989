// SPDX-License-Identifier: MIT
#include "gl/indirect.h"

#include <epoxy/gl.h>

#include "gl/error.h"

namespace lodlab::gl {

void draw_indirect(const Buffer& commands, size_t first, size_t count, unsigned index_type) {
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, commands.id());
  glMultiDrawElementsIndirect(GL_TRIANGLES, index_type,
                              reinterpret_cast<const void*>(first * sizeof(DrawCommand)),
                              static_cast<GLsizei>(count), 0);
  check("glMultiDrawElementsIndirect");
}

}  // namespace lodlab::gl
