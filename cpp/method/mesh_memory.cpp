// SPDX-License-Identifier: MIT
#include "method/mesh_memory.h"

#include <epoxy/gl.h>

#include <limits>

#include "base/errors.h"
#include "gl/error.h"

namespace lodlab {

MeshMemory::MeshMemory(const StoredMesh& mesh) : vertices_(mesh.vertices()), triangles_(mesh.triangles()) {
  if (triangles_ > std::numeric_limits<GLsizei>::max() / 3) {
    throw Unsupported("draw: " + std::to_string(triangles_) + " triangles are more than one draw call takes");
  }
  const auto input = [this](unsigned location, gl::Buffer& buffer, const auto& values, int count,
                            unsigned type) {
    if (values.empty()) return;
    buffer = gl::Buffer(values);
    array_.floats(location, location, count, type, 0);
    array_.source(location, buffer, 0, static_cast<int>(sizeof(values[0])));
  };
  input(0, high_, mesh.high, 3, GL_FLOAT);
  input(1, low_, mesh.low, 3, GL_FLOAT);
  input(2, colors_, mesh.colors, 4, GL_UNSIGNED_BYTE);
  indices_ = gl::Buffer(mesh.indices);
  array_.indices(indices_);
  bytes_ = high_.bytes() + low_.bytes() + colors_.bytes() + indices_.bytes();
}

void MeshMemory::draw(MeshProgram& program, const render::Surface& surface, render::Pass& pass, uint32_t node,
                      uint32_t level) {
  int64_t drawn = 0;
  while (drawn < triangles_) {
    const int64_t count = std::min(triangles_ - drawn, pass.batch_triangles());
    const unsigned name =
        pass.use(program.of(static_cast<bool>(low_)), surface, {static_cast<bool>(colors_), false});
    glProgramUniform2ui(name, glGetUniformLocation(name, "u_tag"), node, level);
    array_.bind();
    glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(3 * count), GL_UNSIGNED_INT,
                   reinterpret_cast<const void*>(3 * sizeof(uint32_t) * static_cast<size_t>(drawn)));
    gl::check("glDrawElements");
    pass.submitted.draw_calls += 1;
    drawn += count;
  }
  pass.submitted.triangles += triangles_;
  pass.submitted.vertices += vertices_;
  pass.submitted.nodes += 1;
  if (uploaded_now_) pass.submitted.upload_bytes += bytes_;
  uploaded_now_ = false;
}

}  // namespace lodlab
