// SPDX-License-Identifier: MIT
// Drawing: a frame is one multi-draw-indirect over its visible patches. Index ranges are shared (ranges.h);
// per-patch data are instanced attributes, found by base instance. Heights lie in one buffer of equal slots,
// which is the vertex buffer.
#include <epoxy/gl.h>

#include <algorithm>
#include <optional>

#include "base/errors.h"
#include "gl/context.h"
#include "gl/error.h"
#include "gl/vertex_array.h"
#include "method/indirect.h"
#include "method/map_memory.h"
#include "methods/seamless/paging.h"
#include "methods/seamless/ranges.h"
#include "methods/seamless/session.h"
#include "render/surface.h"

namespace lodlab::seamless {
namespace {

/// Instanced attributes of one patch, or of a square of it (patch.vert).
struct Instance {
  int32_t col, row;
  int32_t first;        ///< height of its slot
  uint32_t node, bits;  ///< lattice point where it begins: u << 24 | v << 16; level << 8 | log2 of its stride
};

std::vector<std::string> defines_of(const Hierarchy& hierarchy, bool parts) {
  std::vector<std::string> out;
  if (hierarchy.averaged()) out.push_back("LODLAB_AVERAGE");
  if (parts) out.push_back("LODLAB_PARTS");
  return out;
}

}  // namespace

struct SeamlessSession::Gpu {
  /// Patches that one use() draws.
  struct Batch {
    size_t first, count;
    int64_t triangles;
  };

  Gpu(const Hierarchy& hierarchy, const PatchMesh& mesh, Paging& pages, MapPaging& map_pages, bool parts,
      render::Submitted& submitted)
      : program({{"vertex", "seamless/patch.vert"}}, defines_of(hierarchy, parts)),
        field(render::make_surface(hierarchy.frame, hierarchy.coverage())),
        paging(pages),
        ranges(mesh, pages.slots(), map_pages.count() > 0),
        most_index_bytes(Ranges::most_bytes(mesh, hierarchy.layout)),
        heights(pages.capacity()) {
    arrays.floats(0, 0, 1, GL_FLOAT, 0);
    arrays.integers(1, 1, 3, GL_INT, 0);
    arrays.integers(2, 1, 2, GL_UNSIGNED_INT, 12);
    glVertexArrayBindingDivisor(arrays.id(), 1, 1);
    gl::check("glVertexArrayBindingDivisor");
    arrays.source(0, heights, 0, sizeof(float));
    maps.emplace(map_pages, arrays, submitted);
  }

  bool add(const Layout& layout, const CutNode& picked, const MapPatch& square, render::Pass& pass);
  void upload(render::Submitted& submitted);
  bool bring(uint32_t patch, std::optional<double> worth, render::Submitted& submitted);
  void submit(const Layout& layout, render::Pass& pass);
  void draw(const Layout& layout, const Batch& batch, render::Pass& pass);

  render::SurfaceProgram program;
  std::shared_ptr<const render::Surface> field;
  Paging& paging;
  Ranges ranges;
  int64_t most_index_bytes;
  gl::Buffer heights, indices{0}, instances{0}, commands{0};
  size_t index_bytes = 0;  ///< of the ranges, those that the buffer has
  gl::VertexArray arrays;
  std::vector<Instance> instance_data;
  std::vector<gl::DrawCommand> command_data;
  std::vector<Batch> batches;
  std::optional<MapMemory> maps;
};

/// Adds a square of a patch, all of it where there are no maps, with what it draws from. False: this frame
/// uses all the memory that there is.
bool SeamlessSession::Gpu::add(const Layout& layout, const CutNode& picked, const MapPatch& square,
                               render::Pass& pass) {
  if (static_cast<int64_t>(instance_data.size()) == paging.most_pieces()) return false;
  if (!bring(picked.node, std::nullopt, pass.submitted)) return false;
  const auto rows = maps->rows(square, pass.submitted);
  if (!rows) return false;
  maps->add(*rows);
  const Patch p = layout.at(picked.node);
  const int stride = layout.stride_log2(p.level);
  const Ranges::Square cells{static_cast<int>((square.col - layout.col(p)) >> stride),
                             static_cast<int>((square.row - layout.row(p)) >> stride),
                             1 << (square.size_log2 - stride)};
  const Resolutions k = unpack(static_cast<int>(picked.resolution), layout.resolutions);
  const Ranges::Range range = ranges.range(k, layout.clip_x(p), layout.clip_y(p), cells);
  const int64_t triangles = range.indices / 3;
  if (batches.empty() || batches.back().triangles + triangles > pass.batch_triangles())
    batches.push_back({command_data.size(), 0, 0});
  ++batches.back().count;
  batches.back().triangles += triangles;
  const auto first = static_cast<int32_t>(paging.offset(picked.node) / static_cast<int64_t>(sizeof(float)));
  command_data.push_back(
      {range.indices, 1, range.first_index, first, static_cast<uint32_t>(instance_data.size())});
  instance_data.push_back({static_cast<int32_t>(layout.col(p)), static_cast<int32_t>(layout.row(p)), first,
                           picked.node,
                           static_cast<uint32_t>(cells.u << 24 | cells.v << 16 | p.level << 8 | stride)});
  pass.submitted.triangles += triangles;
  pass.submitted.vertices += range.vertices;
  return true;
}

/// Brings what changed to the GPU. Index ranges that a frame adds stay.
void SeamlessSession::Gpu::upload(render::Submitted& submitted) {
  send(instances, as_bytes(instance_data), submitted);
  send(commands, as_bytes(command_data), submitted);
  maps->upload(arrays, submitted);
  const auto all = as_bytes(ranges.indices());
  if (static_cast<int64_t>(all.size()) > indices.bytes()) {
    const auto size = static_cast<int64_t>(all.size());
    indices = gl::Buffer(std::max(size, std::min(2 * indices.bytes(), most_index_bytes)));
    index_bytes = 0;
    arrays.indices(indices);
  }
  if (index_bytes < all.size()) {
    indices.upload(static_cast<int64_t>(index_bytes), all.subspan(index_bytes));
    submitted.upload_bytes += static_cast<int64_t>(all.size() - index_bytes);
    index_bytes = all.size();
  }
  arrays.source(1, instances, 0, sizeof(Instance));
}

void SeamlessSession::Gpu::draw(const Layout& layout, const Batch& batch, render::Pass& pass) {
  const unsigned name = pass.use(program, *field, maps->shown());
  maps->bind();
  glUniform2i(glGetUniformLocation(name, "u_last"), static_cast<GLint>(layout.last_col()),
              static_cast<GLint>(layout.last_row()));
  glUniform1i(glGetUniformLocation(name, "u_segments"), layout.segments());
  arrays.bind();
  gl::draw_indirect(commands, batch.first, batch.count, GL_UNSIGNED_INT);
  ++pass.submitted.draw_calls;
}

bool SeamlessSession::Gpu::bring(uint32_t patch, std::optional<double> worth, render::Submitted& submitted) {
  return lodlab::bring(paging, patch, worth, [&](const Residency::Upload& upload) {
    heights.upload(upload.offset, *upload.page);
    submitted.upload_bytes += static_cast<int64_t>(upload.page->size());
  });
}

/// Draws what was added, and forgets it.
void SeamlessSession::Gpu::submit(const Layout& layout, render::Pass& pass) {
  if (!command_data.empty()) {
    upload(pass.submitted);
    for (const Batch& batch : batches) draw(layout, batch, pass);
  }
  instance_data.clear();
  command_data.clear();
  batches.clear();
  maps->begin();
}

/// A cut that needs more patches than memory holds is drawn in rounds, in which they take turns. Selection
/// never leads to one while streaming, but a cut of another session may.
void SeamlessSession::draw(const Cut& cut, render::Pass& pass) {
  gl::ensure_context();
  const Layout& layout = hierarchy_->layout;
  if (!gpu_) gpu_ = std::make_shared<Gpu>(*hierarchy_, mesh_, *paging_, *maps_, parts_, pass.submitted);
  Gpu& gpu = *gpu_;
  if (paging_->streams()) gpu.bring(0, std::nullopt, pass.submitted);
  // The last levels first: they are nearest and hide what comes after.
  const std::vector<CutNode>& nodes = cut.claim->nodes;
  for (auto picked = nodes.rbegin(); picked != nodes.rend(); ++picked) {
    if (!picked->visible && !pass.everything()) continue;
    ++pass.submitted.nodes;
    for (const MapPatch& square : maps_->patches(*picked, pass.camera())) {
      if (gpu.add(layout, *picked, square, pass)) continue;
      gpu.submit(layout, pass);
      paging_->next_frame();
      maps_->next_frame();
      if (!gpu.add(layout, *picked, square, pass))
        throw Unsupported("seamless: gpu_cache_mb cannot hold a single patch of this cut");
    }
  }
  gpu.submit(layout, pass);
  if (paging_->streams()) admit_wanted(pass.submitted);
}

/// What arrived meanwhile becomes resident for the next frame.
void SeamlessSession::admit_wanted(render::Submitted& submitted) {
  const int64_t before = submitted.upload_bytes, each = paging_->slots().bytes();
  for (const Residency::Want& want : paging_->wanted()) {
    if (submitted.upload_bytes - before + each > paging_->upload_bytes()) break;
    if (paging_->resident(want.unit) || !paging_->resident(paging_->parent(want.unit))) continue;
    gpu_->bring(want.unit, want.priority, submitted);
  }
  gpu_->maps->admit_wanted(before + paging_->upload_bytes(), submitted);
}

void SeamlessSession::settle() { paging_->settle(); }

int64_t SeamlessSession::resident_bytes() const {
  if (!gpu_) return 0;
  const Gpu& gpu = *gpu_;
  int64_t sum = gpu.field->bytes() + gpu.maps->bytes();
  for (const gl::Buffer* b : {&gpu.heights, &gpu.indices, &gpu.instances, &gpu.commands}) sum += b->bytes();
  return sum;
}

}  // namespace lodlab::seamless
