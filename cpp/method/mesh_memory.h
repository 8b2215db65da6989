// SPDX-License-Identifier: MIT
// A stored mesh on the GPU, and its drawing. GL is here as in map_memory.h.
#pragma once

#include "gl/vertex_array.h"
#include "method/mesh_pages.h"
#include "render/pass.h"

namespace lodlab {

/// The program that draws stored meshes (shaders/common/mesh.vert), one a session.
class MeshProgram {
 public:
  /// The variant for a mesh that has, or has not, what single floats leave.
  render::SurfaceProgram& of(bool low) { return low ? sums_ : single_; }

 private:
  render::SurfaceProgram single_{{"vertex", "common/mesh.vert"}};
  render::SurfaceProgram sums_{{{"vertex", "common/mesh.vert"}}, std::vector<std::string>{"MESH_LOW"}};
};

class MeshMemory {
 public:
  /// Unsupported for more triangles than one draw call takes.
  explicit MeshMemory(const StoredMesh& mesh);

  /// All its triangles, as a node of a level; counted as submitted.
  void draw(MeshProgram& program, const render::Surface& surface, render::Pass& pass, uint32_t node,
            uint32_t level);
  int64_t bytes() const { return bytes_; }

 private:
  gl::Buffer high_, low_, colors_, indices_;
  gl::VertexArray array_;
  int64_t vertices_, triangles_, bytes_;
  bool uploaded_now_ = true;  ///< the next draw reports the upload
};

}  // namespace lodlab
