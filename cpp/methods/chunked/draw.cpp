// SPDX-License-Identifier: MIT
// Drawing: one buffer holds the vertices and indices of all resident chunks; a frame is one
// multi-draw-indirect over its visible chunks, or, with colour textures, one call a chunk (Ulrich 2002,
// section 13: a texture a chunk). Per-chunk data are instanced attributes, found by base instance.
#include <epoxy/gl.h>

#include <algorithm>
#include <unordered_map>

#include "base/errors.h"
#include "gl/context.h"
#include "gl/error.h"
#include "gl/texture.h"
#include "gl/vertex_array.h"
#include "method/indirect.h"
#include "methods/chunked/session.h"
#include "render/surface.h"

namespace lodlab::chunked {
namespace {

/// Instanced attributes of one chunk (chunk.vert): what every pass needs in one fetch, the rest in another.
struct Instance {
  float col, row, morph;
  uint32_t skirt_begin, node;
  uint32_t square;  // side << 8 | level
};

static_assert(sizeof(Instance) == kInstanceBytes && sizeof(gl::DrawCommand) == kCommandBytes);

GLenum index_type(const ChunkedHierarchy& tree) {
  return tree.index_bytes == 2 ? GL_UNSIGNED_SHORT : GL_UNSIGNED_INT;
}

}  // namespace

struct ChunkedSession::Gpu {
  gl::Buffer geometry;
  gl::Buffer instances{0}, commands{0};
  gl::VertexArray arrays;
  std::unordered_map<uint32_t, gl::Texture> textures;
  std::shared_ptr<const render::Surface> field;
  render::SurfaceProgram program;
  std::vector<Instance> instance_data;
  std::vector<gl::DrawCommand> command_data;
  std::vector<uint32_t> dropped;

  explicit Gpu(const ChunkedHierarchy& tree, int64_t buffer_bytes)
      : geometry(std::max<int64_t>(buffer_bytes, 16)),
        field(render::make_surface(tree.frame, tree.coverage())),
        program({{"vertex", "chunked/chunk.vert"}}) {
    arrays.integers(0, 0, 4, GL_UNSIGNED_SHORT, 0);
    arrays.floats(1, 1, 3, GL_FLOAT, 0);
    arrays.integers(2, 1, 3, GL_UNSIGNED_INT, 12);
    glVertexArrayBindingDivisor(arrays.id(), 1, 1);
    arrays.source(0, geometry, 0, sizeof(Vertex));
    arrays.indices(geometry);
    gl::check("glVertexArrayBindingDivisor");
  }

  void upload(const ChunkedHierarchy& tree, const Residency::Upload& upload, render::Submitted& submitted) {
    const Bytes& page = *upload.page;
    geometry.upload(upload.offset, std::span(page).subspan(sizeof(PageHead)));
    submitted.upload_bytes += static_cast<int64_t>(page.size() - sizeof(PageHead));
    if (upload.beside == nullptr) return;
    const int side = tree.node[upload.unit].texture_side + 1;
    int mips = 1;
    while ((side >> mips) > 0) ++mips;
    gl::Texture texture = gl::Texture::array(GL_RGBA8, side, side, 1, mips);
    texture.upload_rgba(0, 0, 0, 0, side, side, upload.beside->data());
    texture.make_mips();
    submitted.upload_bytes += static_cast<int64_t>(upload.beside->size());
    textures[upload.unit] = std::move(texture);
  }

  void drop() {
    for (const uint32_t node : dropped) textures.erase(node);
    dropped.clear();
  }

  void submit(const ChunkedHierarchy& tree, int64_t most, render::Pass& pass);
  void draw_all(const ChunkedHierarchy& tree, render::Pass& pass);
  void draw_textured(const ChunkedHierarchy& tree, unsigned program, render::Pass& pass);
};

/// Draws what was added, and forgets it.
void ChunkedSession::Gpu::submit(const ChunkedHierarchy& tree, int64_t most, render::Pass& pass) {
  if (command_data.empty()) return;
  const auto chunks = static_cast<int64_t>(instance_data.size());
  reserve(commands, chunks * kCommandBytes, most * kCommandBytes);
  if (reserve(instances, chunks * kInstanceBytes, most * kInstanceBytes))
    arrays.source(1, instances, 0, sizeof(Instance));
  send(instances, as_bytes(instance_data), pass.submitted);
  const bool textured = !textures.empty();
  const unsigned name = pass.use(program, *field, {.colors = textured});
  glUniform2f(glGetUniformLocation(name, "u_quantum"), static_cast<float>(tree.quantizer.quantum),
              static_cast<float>(tree.quantizer.base));
  arrays.bind();
  if (textured) {
    draw_textured(tree, name, pass);
  } else {
    draw_all(tree, pass);
  }
  instance_data.clear();
  command_data.clear();
}

void ChunkedSession::Gpu::draw_all(const ChunkedHierarchy& tree, render::Pass& pass) {
  send(commands, as_bytes(command_data), pass.submitted);
  gl::draw_indirect(commands, 0, command_data.size(), index_type(tree));
  pass.submitted.draw_calls += 1;
}

void ChunkedSession::Gpu::draw_textured(const ChunkedHierarchy& tree, unsigned name, render::Pass& pass) {
  const GLint texels = glGetUniformLocation(name, "u_texels");
  for (size_t i = 0; i < command_data.size(); ++i) {
    const gl::DrawCommand& c = command_data[i];
    const Node& node = tree.node[instance_data[i].node];
    textures.at(instance_data[i].node).bind(0);
    glUniform1f(texels, static_cast<float>(node.texture_side));
    glDrawElementsInstancedBaseVertexBaseInstance(
        GL_TRIANGLES, static_cast<GLsizei>(c.count), index_type(tree),
        reinterpret_cast<const void*>(static_cast<uintptr_t>(c.first_index) *
                                      static_cast<uintptr_t>(tree.index_bytes)),
        1, c.base_vertex, c.base_instance);
  }
  gl::check("glDrawElementsInstancedBaseVertexBaseInstance");
  pass.submitted.draw_calls += static_cast<int64_t>(command_data.size());
}

ChunkedSession::ChunkedSession(std::shared_ptr<const ChunkedHierarchy> hierarchy, const Options& options)
    : ChunkedSession(hierarchy, options, make_plan(hierarchy, paging_of(options))) {}

ChunkedSession::ChunkedSession(std::shared_ptr<const ChunkedHierarchy> hierarchy, const Options& options,
                               Plan plan)
    : hierarchy_(std::move(hierarchy)),
      skirts_(options.text("cracks") == "skirt"),
      residency_(hierarchy_->store, std::move(plan.setup)),
      most_pieces_(plan.most_pieces) {
  projection_ = projection_of(options, !hierarchy_->frame.planet);
  const std::string& morph = options.text("morph");
  morph_ = morph == "true" ? Morph::kBudget : morph == "formula4" ? Morph::kFormula4 : Morph::kNone;
}

ChunkedSession::~ChunkedSession() = default;

std::unique_ptr<Session> make_session(std::shared_ptr<const ChunkedHierarchy> hierarchy,
                                      const Options& options) {
  return std::make_unique<ChunkedSession>(std::move(hierarchy), options);
}

int64_t ChunkedSession::resident_bytes() const {
  if (gpu_ == nullptr) return 0;
  return gpu_->field->bytes() + gpu_->geometry.bytes() + residency_.beside_used() + gpu_->instances.bytes() +
         gpu_->commands.bytes();
}

void ChunkedSession::settle() { residency_.settle(); }

/// Adds a chunk, and brings one that is not there: of a recorded cut, drawn again after its data went. False:
/// this frame uses all the memory that there is.
bool ChunkedSession::add(const CutNode& picked, render::Pass& pass) {
  const ChunkedHierarchy& tree = *hierarchy_;
  Gpu& gpu = *gpu_;
  const Node& node = tree.node[picked.node];
  if (static_cast<int64_t>(gpu.command_data.size()) == most_pieces_) return false;
  if (residency_.offset(picked.node) < 0) {
    const auto upload = residency_.admit(picked.node, true, gpu.dropped);
    gpu.drop();
    if (!upload) return false;
    gpu.upload(tree, *upload, pass.submitted);
  }
  residency_.touch(picked.node);
  const int64_t offset = residency_.offset(picked.node);
  const auto base_vertex = static_cast<int32_t>(offset / 8);
  const int64_t first_index = (offset + int64_t{node.vertices} * 8) / tree.index_bytes;
  const uint32_t count = skirts_ ? node.indices : node.surface_indices;
  gpu.command_data.push_back({count, 1, static_cast<uint32_t>(first_index), base_vertex,
                              static_cast<uint32_t>(gpu.instance_data.size())});
  gpu.instance_data.push_back({static_cast<float>(node.col), static_cast<float>(node.row), picked.morph,
                               static_cast<uint32_t>(base_vertex) + node.surface_vertices, picked.node,
                               static_cast<uint32_t>(tree.root_side >> node.level) << 8 | node.level});
  pass.submitted.triangles += count / 3;
  pass.submitted.filler_triangles += (count - node.surface_indices) / 3;
  pass.submitted.vertices += skirts_ ? node.vertices : node.surface_vertices;
  ++pass.submitted.nodes;
  return true;
}

/// A cut that needs more than memory holds is drawn in rounds, in which chunks take turns. Selection never
/// leads to one while streaming, but a cut of another session may.
void ChunkedSession::draw(const Cut& cut, render::Pass& pass) {
  gl::ensure_context();
  const ChunkedHierarchy& tree = *hierarchy_;
  if (gpu_ == nullptr) {
    gpu_ = std::make_unique<Gpu>(tree, residency_.capacity());
    const size_t first = residency_.streams() ? tree.roots : tree.node.size();
    for (uint32_t i = 0; i < first; ++i) {
      if (const auto upload = residency_.admit(i, true, gpu_->dropped))
        gpu_->upload(tree, *upload, pass.submitted);
    }
  }
  for (const CutNode& picked : cut.claim->nodes) {
    if ((!picked.visible && !pass.everything()) || add(picked, pass)) continue;
    gpu_->submit(tree, most_pieces_, pass);
    residency_.next_frame();
    if (!add(picked, pass)) {
      throw Unsupported("chunked: gpu_cache_mb cannot hold node " + std::to_string(picked.node) +
                        " beside the roots");
    }
  }
  gpu_->submit(tree, most_pieces_, pass);
  if (residency_.streams()) admit_wanted(pass.submitted);
}

/// What arrived meanwhile becomes resident for the next frame.
void ChunkedSession::admit_wanted(render::Submitted& submitted) {
  const int64_t most = submitted.upload_bytes + kUploadPerFrame;
  for (const Residency::Want& want : residency_.wanted()) {
    if (submitted.upload_bytes >= most) break;
    if (residency_.resident(want.unit)) continue;
    const auto upload = residency_.admit(want.unit, false, gpu_->dropped);
    gpu_->drop();
    if (upload) gpu_->upload(*hierarchy_, *upload, submitted);
  }
}

}  // namespace lodlab::chunked
