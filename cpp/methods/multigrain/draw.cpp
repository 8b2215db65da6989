// SPDX-License-Identifier: MIT
// Drawing: a frame is one multi-draw-indirect over its visible nodes. Grids are shared (grids.h); per-node
// data are instanced attributes, found by base instance. Heights lie in one buffer, tile by tile (tiles.h),
// and stay there: it is both the vertex buffer and, for vertices that stitching moves, a storage buffer. A
// map of the strides drawn, a byte a block, tells each edge what lies beside it.
#include <epoxy/gl.h>

#include <algorithm>
#include <optional>

#include "base/errors.h"
#include "gl/buffer.h"
#include "gl/context.h"
#include "gl/error.h"
#include "gl/vertex_array.h"
#include "methods/multigrain/color_memory.h"
#include "methods/multigrain/grids.h"
#include "methods/multigrain/session.h"
#include "methods/multigrain/tiles.h"
#include "render/field_resources.h"

namespace lodlab::multigrain {
namespace {

enum Binding : unsigned { kHeights = 3, kStrides = 4 };  // grid.vert

/// Instanced attributes of one node (grid.vert).
struct Instance {
  int32_t col, row;
  int32_t height, tile_rows;  ///< index of its first height
  uint32_t node, bits;        ///< level << 16 | side << 8 | stride
};

struct Command {  // DrawElementsIndirectCommand
  uint32_t count, instances, first_index;
  int32_t base_vertex;
  uint32_t base_instance;
};

int64_t bytes_of(int64_t heights) { return heights * static_cast<int64_t>(sizeof(float)); }

/// Makes room: never smaller, at least doubled.
void reserve(gl::Buffer& buffer, size_t bytes) {
  const auto needed = static_cast<int64_t>(bytes);
  if (needed > buffer.bytes()) buffer = gl::Buffer(std::max(needed, 2 * buffer.bytes()));
}

/// Heights of a tile on the GPU: whole strips (grids.h).
int64_t strip_heights(const Tile& tile) { return strips(tile.cols) * tile.rows * kStripPitch; }

/// A tile's heights, row by row, put into strips. What lies past the last strip's end is never drawn.
std::vector<float> in_strips(const Tile& tile, const std::vector<float>& rows) {
  std::vector<float> out(static_cast<size_t>(strip_heights(tile)));
  auto to = out.begin();
  for (int64_t first = 0; first + 1 < tile.cols; first += kStrip) {
    const int64_t count = std::min(kStripPitch, tile.cols - first);
    for (int64_t j = 0; j < tile.rows; ++j, to += kStripPitch) {
      std::copy_n(rows.begin() + (j * tile.cols + first), count, to);
    }
  }
  return out;
}

/// Tiles in the order of their first use.
class TileMemory {
 public:
  explicit TileMemory(const Forest& forest)
      : tiles_(forest.layout), offsets_(static_cast<size_t>(tiles_.count()), -1) {
    GLint64 limit = 0;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &limit);
    most_ = std::min<int64_t>(limit, bytes_of(INT32_MAX));
  }

  struct Place {
    int64_t height;  ///< index of the height at the node's first sample
    int64_t tile_rows;
  };
  /// Of a node drawn with this stride; brings its tile if need be.
  Place place(const Forest& forest, const Patch& node, int stride_log2, render::Submitted& submitted) {
    const int64_t id = tiles_.id(stride_log2, node.row, node.col);
    const Tile tile = tiles_.at(id);
    int64_t& offset = offsets_[static_cast<size_t>(id)];
    if (offset < 0) offset = add(in_strips(tile, forest.tile(id)), submitted);
    const int64_t row = (node.row - tile.row) >> stride_log2, col = (node.col - tile.col) >> stride_log2;
    return {offset + (col / kStrip * tile.rows + row) * kStripPitch + col % kStrip, tile.rows};
  }
  const gl::Buffer& heights() const { return heights_; }

 private:
  int64_t add(const std::vector<float>& heights, render::Submitted& submitted) {
    const int64_t offset = used_, bytes = bytes_of(static_cast<int64_t>(heights.size()));
    grow(bytes_of(offset) + bytes);
    heights_.upload(bytes_of(offset), as_bytes(heights));
    submitted.upload_bytes += bytes;
    used_ += static_cast<int64_t>(heights.size());
    return offset;
  }

  void grow(int64_t bytes) {
    if (bytes <= heights_.bytes()) return;
    if (bytes > most_) {
      throw Unsupported("multigrain: " + std::to_string(bytes) +
                        " bytes of heights are above this device's limit of " + std::to_string(most_) +
                        " in one buffer");
    }
    gl::Buffer larger(std::min(std::max(bytes, 2 * heights_.bytes()), most_));
    glCopyNamedBufferSubData(heights_.id(), larger.id(), 0, 0, static_cast<GLsizeiptr>(bytes_of(used_)));
    gl::check("glCopyNamedBufferSubData");
    heights_ = std::move(larger);
  }

  Tiles tiles_;
  std::vector<int64_t> offsets_;  ///< -1: not there yet
  int64_t used_ = 0, most_;       ///< heights; bytes
  gl::Buffer heights_{0};
};

}  // namespace

struct MultigrainSession::Gpu {
  /// Nodes that one use() draws.
  struct Batch {
    size_t first, count;
    int64_t triangles;
  };

  Gpu(const Forest& forest, double texels_per_pixel)
      : field(render::make_field_resources(forest.frame, forest.coverage())), tiles(forest) {
    arrays.floats(0, 0, 1, GL_FLOAT, 0);
    arrays.integers(1, 1, 4, GL_INT, 0);
    arrays.integers(2, 1, 2, GL_UNSIGNED_INT, 16);
    glVertexArrayBindingDivisor(arrays.id(), 1, 1);
    gl::check("glVertexArrayBindingDivisor");
    if (Colors::in(*forest.store)) colors.emplace(forest, texels_per_pixel, arrays);
  }

  void add(const Forest& forest, const CutNode& picked, render::Pass& pass);
  void add(const Forest& forest, const CutNode& picked, const Patch& patch, render::Pass& pass);
  void upload(render::Submitted& submitted);
  void draw(const Layout& layout, const Batch& batch, render::Pass& pass);

  render::SurfaceProgram program{{"vertex", "multigrain/grid.vert"}};
  std::shared_ptr<const render::FieldResources> field;
  TileMemory tiles;
  Grids grids;
  gl::Buffer indices{0}, instances{0}, commands{0}, strides{0};
  gl::VertexArray arrays;
  StrideMap map;
  std::vector<Instance> instance_data;
  std::vector<Command> command_data;
  std::vector<Batch> batches;
  std::optional<ColorMemory> colors;
};

/// With colours a node is drawn as the patches that share its grid's vertices, each with a tile of its own.
void MultigrainSession::Gpu::add(const Forest& forest, const CutNode& picked, render::Pass& pass) {
  const Node& node = forest.node[picked.node];
  ++pass.submitted.nodes;
  if (!colors) {
    add(forest, picked, {node.row, node.col, forest.layout.node_log2(node.level), -1}, pass);
    return;
  }
  const int stride = forest.stride_log2(node, static_cast<int>(picked.resolution));
  for (const Patch& patch : colors->patches(picked.node, stride, pass.camera(), pass.submitted))
    add(forest, picked, patch, pass);
}

void MultigrainSession::Gpu::add(const Forest& forest, const CutNode& picked, const Patch& patch,
                                 render::Pass& pass) {
  const Layout& layout = forest.layout;
  const Node& node = forest.node[picked.node];
  const int size = patch.size_log2;
  const int stride = forest.stride_log2(node, static_cast<int>(picked.resolution));
  const int64_t last = patch.row + (int64_t{1} << size);
  const TileMemory::Place place = tiles.place(forest, patch, stride, pass.submitted);
  Shape shape{layout.cells_x(patch.col, size, stride), layout.cells_y(patch.row, size, stride), 0,
              layout.pole_first && patch.row == 0, layout.pole_last && last >= layout.last_row()};
  if (shape.cells_x > kStrip) shape.tile_rows = place.tile_rows;
  const Grids::Range grid = grids.range(shape);
  const int64_t triangles = grid.indices / 3;
  if (batches.empty() || batches.back().triangles + triangles > pass.batch_triangles()) {
    batches.push_back({command_data.size(), 0, 0});
  }
  ++batches.back().count;
  batches.back().triangles += triangles;
  command_data.push_back({grid.indices, 1, grid.first_index, static_cast<int32_t>(place.height),
                          static_cast<uint32_t>(instance_data.size())});
  instance_data.push_back({patch.col, patch.row, static_cast<int32_t>(place.height),
                           static_cast<int32_t>(place.tile_rows), picked.node,
                           static_cast<uint32_t>(node.level << 16 | size << 8 | stride)});
  pass.submitted.triangles += triangles;
  pass.submitted.vertices += (shape.cells_x + 1) * (shape.cells_y + 1);
}

/// Brings what changed to the GPU. Grids that a frame adds stay.
void MultigrainSession::Gpu::upload(render::Submitted& submitted) {
  const auto send = [&](gl::Buffer& buffer, std::span<const std::byte> bytes) {
    reserve(buffer, bytes.size());
    buffer.upload(0, bytes);
    submitted.upload_bytes += static_cast<int64_t>(bytes.size());
  };
  send(instances, as_bytes(instance_data));
  send(commands, as_bytes(command_data));
  send(strides, as_bytes(map));
  if (colors) colors->upload(arrays, submitted);
  if (static_cast<int64_t>(as_bytes(grids.indices()).size()) > indices.bytes()) {
    indices = gl::Buffer(grids.indices());
    submitted.upload_bytes += indices.bytes();
    arrays.indices(indices);
  }
  arrays.source(0, tiles.heights(), 0, sizeof(float));
  arrays.source(1, instances, 0, sizeof(Instance));
}

void MultigrainSession::Gpu::draw(const Layout& layout, const Batch& batch, render::Pass& pass) {
  const unsigned name = pass.use(program, *field, colors.has_value());
  if (colors) colors->bind();
  glUniform2i(glGetUniformLocation(name, "u_last"), static_cast<GLint>(layout.last_col()),
              static_cast<GLint>(layout.last_row()));
  glUniform4i(glGetUniformLocation(name, "u_blocks"), static_cast<GLint>(layout.blocks_x()),
              layout.block_log2(), layout.wraps ? 1 : 0, layout.pole_first + 2 * layout.pole_last);
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kHeights, tiles.heights().id());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kStrides, strides.id());
  arrays.bind();
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, commands.id());
  glMultiDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT,
                              reinterpret_cast<const void*>(batch.first * sizeof(Command)),
                              static_cast<GLsizei>(batch.count), 0);
  gl::check("glMultiDrawElementsIndirect");
  ++pass.submitted.draw_calls;
}

void MultigrainSession::draw(const Cut& cut, render::Pass& pass) {
  gl::ensure_context();
  const Forest& forest = *forest_;
  if (!gpu_) gpu_ = std::make_shared<Gpu>(forest, texels_per_pixel_);
  Gpu& gpu = *gpu_;
  gpu.instance_data.clear();
  gpu.command_data.clear();
  gpu.batches.clear();
  if (gpu.colors) gpu.colors->begin_frame();
  gpu.map.resize(static_cast<size_t>((forest.layout.blocks_x() * forest.layout.blocks_y() + 3) / 4 * 4));
  for (const CutNode& picked : cut.nodes) {
    forest.mark(forest.node[picked.node], static_cast<int>(picked.resolution), gpu.map);
    if (picked.visible || pass.everything()) gpu.add(forest, picked, pass);
  }
  if (gpu.command_data.empty()) return;
  gpu.upload(pass.submitted);
  for (const Gpu::Batch& batch : gpu.batches) gpu.draw(forest.layout, batch, pass);
}

int64_t MultigrainSession::resident_bytes() const {
  if (!gpu_) return 0;
  const Gpu& gpu = *gpu_;
  int64_t sum = gpu.field->bytes() + gpu.tiles.heights().bytes();
  if (gpu.colors) sum += gpu.colors->bytes();
  for (const gl::Buffer* b : {&gpu.indices, &gpu.instances, &gpu.commands, &gpu.strides}) {
    sum += b->bytes();
  }
  return sum;
}

}  // namespace lodlab::multigrain
