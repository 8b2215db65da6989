// SPDX-License-Identifier: MIT
// Draws whose arguments lie in a buffer, where the CPU or a shader has put them.
#pragma once

#include <cstddef>
#include <cstdint>

#include "gl/buffer.h"

namespace lodlab::gl {

/// DrawElementsIndirectCommand.
struct DrawCommand {
  uint32_t count, instances, first_index;
  int32_t base_vertex;
  uint32_t base_instance;
};
static_assert(sizeof(DrawCommand) == 20);

/// Triangles by `count` commands of the buffer, from `first` on. `index_type`: GL_UNSIGNED_INT, ...
void draw_indirect(const Buffer& commands, size_t first, size_t count, unsigned index_type);

}  // namespace lodlab::gl
