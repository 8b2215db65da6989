// SPDX-License-Identifier: MIT
// GL objects of the family: all meshes of all nodes in one buffer.
#pragma once

#include "family.h"
#include "gl/buffer.h"
#include "gl/vertex_array.h"

namespace lodlab::adversaries {

struct FieldSession::Gpu {
  struct Range {
    uint32_t first = 0, count = 0;  ///< indices
    uint32_t vertices = 0;
  };
  explicit Gpu(const FieldHierarchy& hierarchy);

  render::SurfaceProgram program{{"vertex", "adversaries/node.vert"}};
  std::shared_ptr<const render::Surface> field;
  gl::Buffer vertices, indices;
  gl::VertexArray array;
  std::vector<Range> ranges;  ///< node by node, resolution by resolution
  bool uploaded_now = true;   ///< the next draw reports the upload

  int64_t bytes() const { return vertices.bytes() + indices.bytes(); }
};

}  // namespace lodlab::adversaries
