// SPDX-License-Identifier: MIT
// Drawing: a frame is one multi-draw-indirect over its visible nodes. Grids are shared (grids.h); per-node
// data are instanced attributes, found by base instance. Heights lie in one buffer, tile by tile
// (tile_memory.h; several where the device cannot show shaders as much at once, with a call for each): it is
// both the vertex buffer and, for vertices that stitching moves, a storage buffer. A map of the strides
// drawn, a byte a block, tells each edge what lies beside it.
#include <epoxy/gl.h>

#include <algorithm>
#include <optional>

#include "base/errors.h"
#include "gl/context.h"
#include "gl/error.h"
#include "gl/vertex_array.h"
#include "method/indirect.h"
#include "method/map_memory.h"
#include "methods/multigrain/grids.h"
#include "methods/multigrain/lattice.h"
#include "methods/multigrain/session.h"
#include "methods/multigrain/tile_memory.h"
#include "render/surface.h"

namespace lodlab::multigrain {
namespace {

enum Binding : unsigned { kHeightBuffer = 3, kStrideBuffer = 4 };  // grid.vert

/// Instanced attributes of one node (grid.vert).
struct Instance {
  int32_t col, row;
  int32_t height, tile_rows;  ///< index of its first height
  uint32_t node, bits;        ///< level << 16 | side << 8 | stride
};

}  // namespace

struct MultigrainSession::Gpu {
  /// Nodes that one use() draws.
  struct Batch {
    size_t first, count;
    int64_t triangles;
    size_t part;  ///< of the heights; kFringe: the border row
  };
  static constexpr size_t kFringe = SIZE_MAX;
  /// A patch of a node, and where it lies in its tiles.
  struct Pick {
    const CutNode* node;
    MapPatch patch;
    size_t part;
    MapMemory::Rows rows;
  };

  Gpu(const Forest& forest, Paging& pages, MapPaging& map_pages, render::Submitted& submitted)
      : field(render::make_surface(forest.frame, forest.coverage())), paging(pages), tiles(pages) {
    if (forest.frame.planet) {
      lattice.emplace(forest.frame);
      if (!forest.fringe.empty())
        fringe = gl::Buffer(lattice->row(forest.layout.fringe_row(), forest.fringe));
      arrays.integers(0, 0, 4, GL_INT, 0);
    } else {
      arrays.floats(0, 0, 1, GL_FLOAT, 0);
    }
    arrays.integers(1, 1, 4, GL_INT, 0);
    arrays.integers(2, 1, 2, GL_UNSIGNED_INT, 16);
    glVertexArrayBindingDivisor(arrays.id(), 1, 1);
    gl::check("glVertexArrayBindingDivisor");
    for (uint32_t i = 0; paging.streams() && i < paging.roots(); ++i) bring(i, std::nullopt, submitted);
    maps.emplace(map_pages, arrays, submitted);
  }

  bool pick(const CutNode& picked, const MapPatch& patch, uint32_t unit, render::Submitted& submitted);
  void add(const Forest& forest, const Pick& pick, render::Pass& pass);
  void upload(render::Submitted& submitted);
  bool bring(uint32_t unit, std::optional<double> worth, render::Submitted& submitted);
  void submit(const Forest& forest, render::Pass& pass);
  void draw(const Layout& layout, const Batch& batch, render::Pass& pass);

  render::SurfaceProgram program{{"vertex", "multigrain/grid.vert"}};
  std::shared_ptr<const render::Surface> field;
  Paging& paging;
  TileMemory tiles;
  std::optional<Lattice> lattice;  ///< of a planet
  Grids grids;
  gl::Buffer indices{0}, instances{0}, commands{0}, strides{0}, fringe{0};
  gl::VertexArray arrays;
  StrideMap map;
  std::vector<Instance> instance_data;
  std::vector<gl::DrawCommand> command_data, fringe_data;
  std::vector<Batch> batches;
  std::vector<Pick> picks;
  std::optional<MapMemory> maps;
};

/// Brings what a patch draws from. False: this frame uses all the memory that there is.
bool MultigrainSession::Gpu::pick(const CutNode& picked, const MapPatch& patch, uint32_t unit,
                                  render::Submitted& submitted) {
  if (!bring(unit, std::nullopt, submitted)) return false;
  const auto rows = maps->rows(patch, submitted);
  if (!rows) return false;
  picks.push_back({&picked, patch, tiles.place(paging, unit, 0, 0).part, *rows});
  return true;
}

/// With maps a node is drawn as the patches that share its grid's vertices, each with a tile of its own.
void MultigrainSession::Gpu::add(const Forest& forest, const Pick& pick, render::Pass& pass) {
  const Layout& layout = forest.layout;
  const CutNode& picked = *pick.node;
  const MapPatch& patch = pick.patch;
  const Node& node = forest.node[picked.node];
  const int size = patch.size_log2;
  const int stride = forest.stride_log2(node, static_cast<int>(picked.resolution));
  const int64_t last = patch.row + (int64_t{1} << size);
  const uint32_t unit = paging.unit(node, static_cast<int>(picked.resolution));
  const TileMemory::Place place = tiles.place(paging, unit, patch.row, patch.col);
  Shape shape{layout.cells_x(patch.col, size, stride), layout.cells_y(patch.row, size, stride), 0,
              layout.pole_first && patch.row == 0, layout.pole_last && last >= layout.last_row()};
  if (shape.cells_x > kStrip) shape.tile_rows = place.tile_rows;
  const Grids::Range grid = grids.range(shape);
  const int64_t triangles = grid.indices / 3;
  if (batches.empty() || batches.back().part != place.part ||
      batches.back().triangles + triangles > pass.batch_triangles()) {
    batches.push_back({command_data.size(), 0, 0, place.part});
  }
  ++batches.back().count;
  batches.back().triangles += triangles;
  command_data.push_back({grid.indices, 1, grid.first_index, static_cast<int32_t>(place.height),
                          static_cast<uint32_t>(instance_data.size())});
  if (const int64_t fans = layout.fringe_triangles(patch.row, patch.col, size, stride); fans > 0) {
    const int64_t width = layout.cells_x(patch.col, size, 0);
    const Grids::Range range = grids.fringe(width, stride, layout.fringe_first);
    fringe_data.push_back({range.indices, 1, range.first_index, static_cast<int32_t>(patch.col),
                           static_cast<uint32_t>(instance_data.size())});
    pass.submitted.triangles += fans;
    pass.submitted.vertices += width + 1;
  }
  instance_data.push_back({patch.col, patch.row, static_cast<int32_t>(place.height),
                           static_cast<int32_t>(place.tile_rows), picked.node,
                           static_cast<uint32_t>(node.level << 16 | size << 8 | stride)});
  maps->add(pick.rows);
  pass.submitted.triangles += triangles;
  pass.submitted.vertices += (shape.cells_x + 1) * (shape.cells_y + 1);
}

/// Brings what changed to the GPU. Grids that a frame adds stay.
void MultigrainSession::Gpu::upload(render::Submitted& submitted) {
  send(instances, as_bytes(instance_data), submitted);
  send(commands, as_bytes(command_data), submitted);
  send(strides, as_bytes(map), submitted);
  maps->upload(arrays, submitted);
  if (static_cast<int64_t>(as_bytes(grids.indices()).size()) > indices.bytes()) {
    indices = gl::Buffer(grids.indices());
    submitted.upload_bytes += indices.bytes();
    arrays.indices(indices);
  }
  arrays.source(1, instances, 0, sizeof(Instance));
}

void MultigrainSession::Gpu::draw(const Layout& layout, const Batch& batch, render::Pass& pass) {
  const unsigned name = pass.use(program, *field, maps->shown());
  maps->bind();
  glUniform2i(glGetUniformLocation(name, "u_last"), static_cast<GLint>(layout.last_col()),
              static_cast<GLint>(layout.last_row()));
  glUniform4i(glGetUniformLocation(name, "u_blocks"), static_cast<GLint>(layout.blocks_x()),
              layout.block_log2(), layout.wraps ? 1 : 0, layout.pole_first + 2 * layout.pole_last);
  if (lattice) {
    const Lattice::Eye eye = lattice->eye(pass.camera().eye);
    glUniform3i(glGetUniformLocation(name, "u_eye_cell"), eye.cell.x, eye.cell.y, eye.cell.z);
    glUniform3f(glGetUniformLocation(name, "u_eye_rest"), eye.rest.x, eye.rest.y, eye.rest.z);
    glUniform2f(glGetUniformLocation(name, "u_lattice"), static_cast<float>(lattice->cell()),
                static_cast<float>(lattice->quantum()));
  }
  const bool along_border = batch.part == kFringe;
  glUniform1i(glGetUniformLocation(name, "u_fringe"),
              along_border ? static_cast<GLint>(layout.fringe_row()) : -1);
  const gl::Buffer& vertices = along_border ? fringe : tiles.part(batch.part);
  arrays.source(0, vertices, 0, static_cast<int>(paging.vertex_bytes()));
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kHeightBuffer, vertices.id());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kStrideBuffer, strides.id());
  arrays.bind();
  gl::draw_indirect(commands, batch.first, batch.count, GL_UNSIGNED_INT);
  ++pass.submitted.draw_calls;
}

bool MultigrainSession::Gpu::bring(uint32_t unit, std::optional<double> worth, render::Submitted& submitted) {
  return lodlab::bring(paging, unit, worth,
                       [&](const Residency::Upload& upload) { tiles.put(upload, submitted); });
}

/// Draws what was picked, and forgets it.
void MultigrainSession::Gpu::submit(const Forest& forest, render::Pass& pass) {
  std::stable_sort(picks.begin(), picks.end(), [](const Pick& a, const Pick& b) { return a.part < b.part; });
  instance_data.clear();
  command_data.clear();
  fringe_data.clear();
  batches.clear();
  maps->begin();
  for (const Pick& pick : picks) add(forest, pick, pass);
  picks.clear();
  if (command_data.empty()) return;
  if (!fringe_data.empty()) {
    batches.push_back({command_data.size(), fringe_data.size(), 0, kFringe});
    command_data.insert(command_data.end(), fringe_data.begin(), fringe_data.end());
  }
  upload(pass.submitted);
  for (const Batch& batch : batches) draw(forest.layout, batch, pass);
}

/// The next round: what this frame has drawn makes room.
void MultigrainSession::next_round(render::Pass& pass) {
  gpu_->submit(*forest_, pass);
  paging_->residency().next_frame();
  maps_->next_frame();
}

/// A cut that needs more tiles than memory holds is drawn in rounds, in which they take turns. Selection
/// never leads to one while streaming, but a cut of another session may.
void MultigrainSession::draw(const Cut& cut, render::Pass& pass) {
  gl::ensure_context();
  const Forest& forest = *forest_;
  if (!gpu_) gpu_ = std::make_shared<Gpu>(forest, *paging_, *maps_, pass.submitted);
  Gpu& gpu = *gpu_;
  gpu.map.resize(static_cast<size_t>((forest.layout.blocks_x() * forest.layout.blocks_y() + 3) / 4 * 4));
  for (const CutNode& picked : cut.claim->nodes)
    forest.mark(forest.node[picked.node], static_cast<int>(picked.resolution), gpu.map);
  for (const CutNode& picked : cut.claim->nodes) {
    if (!picked.visible && !pass.everything()) continue;
    const uint32_t unit = paging_->unit(forest.node[picked.node], static_cast<int>(picked.resolution));
    ++pass.submitted.nodes;
    for (const MapPatch& patch : maps_->patches(picked, pass.camera())) {
      if (gpu.pick(picked, patch, unit, pass.submitted)) continue;
      next_round(pass);
      if (!gpu.pick(picked, patch, unit, pass.submitted))
        throw Unsupported("multigrain: gpu_cache_mb cannot hold a single tile of this cut");
    }
  }
  gpu.submit(forest, pass);
  if (paging_->streams()) admit_wanted(pass.submitted);
}

/// What arrived meanwhile becomes resident for the next frame.
void MultigrainSession::admit_wanted(render::Submitted& submitted) {
  const Residency& residency = paging_->residency();
  const int64_t most = submitted.upload_bytes + kUploadPerFrame;
  for (const Residency::Want& want : residency.wanted()) {
    if (submitted.upload_bytes >= most) break;
    if (residency.resident(want.unit) || !residency.resident(paging_->parent(want.unit))) continue;
    gpu_->bring(want.unit, want.priority, submitted);
  }
  gpu_->maps->admit_wanted(most, submitted);
}

void MultigrainSession::settle() { paging_->residency().settle(); }

int64_t MultigrainSession::resident_bytes() const {
  if (!gpu_) return 0;
  const Gpu& gpu = *gpu_;
  int64_t sum = gpu.field->bytes() + gpu.tiles.bytes() + gpu.maps->bytes();
  for (const gl::Buffer* b : {&gpu.indices, &gpu.instances, &gpu.commands, &gpu.strides, &gpu.fringe}) {
    sum += b->bytes();
  }
  return sum;
}

}  // namespace lodlab::multigrain
