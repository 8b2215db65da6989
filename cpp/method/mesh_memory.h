// SPDX-License-Identifier: MIT
// Stored meshes on the GPU, and their drawing. GL is here as in map_memory.h.
#pragma once

#include <span>
#include <vector>

#include "gl/indirect.h"
#include "gl/vertex_array.h"
#include "method/mesh_pages.h"
#include "render/pass.h"

namespace lodlab {

/// All meshes of a store, one after the other in a few buffers; those of a cut are drawn with one call.
class MeshMemory {
 public:
  /// Unsupported for more than 32-bit indices tell apart.
  explicit MeshMemory(const std::vector<StoredMesh>& meshes);

  struct Item {
    uint32_t mesh, node, level;
  };
  /// Whole meshes, as nodes of levels; counted as submitted.
  void draw(std::span<const Item> items, const render::Surface& surface, render::Pass& pass);
  int64_t bytes() const;

 private:
  struct Place {
    uint32_t first_index;
    int32_t base_vertex;
    int64_t vertices, triangles;
  };
  struct Tag {
    uint32_t node, level;
  };
  void submit(const render::Surface& surface, render::Pass& pass);

  render::SurfaceProgram program_;
  gl::Buffer high_, low_, colors_, indices_, tags_{0}, commands_{0};
  gl::VertexArray array_;
  std::vector<Place> places_;
  std::vector<Tag> tag_data_;
  std::vector<gl::DrawCommand> command_data_;
  bool uploaded_now_ = true;  ///< the next draw reports the upload
};

}  // namespace lodlab
