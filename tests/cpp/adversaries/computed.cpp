// SPDX-License-Identifier: MIT
// The family, selecting on the GPU. A frame's select() leaves the uniforms of a selection; prepare() runs it
// in a compute shader (select.comp), which writes a draw command for each node; draw() submits them. The
// claim is the twin's: the same choice made on the CPU, in doubles as in the shader, by the same formula. A
// cut by hand has its commands written by the CPU.
#include <epoxy/gl.h>

#include <algorithm>
#include <limits>

#include "gl/error.h"
#include "gl/indirect.h"
#include "gl/program.h"
#include "gpu.h"
#include "store/format.h"

namespace lodlab::adversaries {
namespace {

enum Binding : unsigned { kNodeBuffer = 3, kCommandBuffer = 4, kCountBuffer = 5, kSelectionBlock = 1 };

/// A node as the shader has it (std430).
struct GpuNode {
  double lo[4], hi[4];  ///< the fourth: the error at resolution 0, at 1
  uint32_t first[2], count[2];
  uint32_t vertices, padding[3];
};
static_assert(sizeof(GpuNode) == 96);

/// What the shader selects by (std140).
struct Uniforms {
  double planes[5][4];      ///< the fourth: how far inside
  double eye[4], scale[4];  ///< scale: K, near, s, the pixel error or -1
  int32_t triangles, nodes, count, padding;
};
static_assert(sizeof(Uniforms) == 240);

struct Counts {
  uint32_t triangles, vertices, nodes, padding;
};

struct Selection : Record {
  Uniforms uniforms;
};

int32_t limit(std::optional<int64_t> budget) {
  constexpr int64_t kMost = std::numeric_limits<int32_t>::max();
  return static_cast<int32_t>(std::min(budget.value_or(kMost), kMost));
}

Uniforms uniforms_of(const Camera& camera, const Budget& allowed, size_t nodes) {
  Uniforms u{};
  for (int i = 0; i < 5; ++i) {
    for (int axis = 0; axis < 3; ++axis) u.planes[i][axis] = camera.planes[static_cast<size_t>(i)][axis];
    u.planes[i][3] = i == 4 ? camera.near_plane : 0.0;
  }
  for (int axis = 0; axis < 3; ++axis) u.eye[axis] = camera.eye[axis];
  u.scale[0] = camera.K;
  u.scale[1] = camera.near_plane;
  u.scale[2] = camera.s;
  u.scale[3] = allowed.pixel_error.value_or(-1.0);
  u.triangles = limit(allowed.triangles);
  u.nodes = limit(allowed.nodes);
  u.count = static_cast<int32_t>(nodes);
  return u;
}

class ComputedSession : public FieldSession {
 public:
  using FieldSession::FieldSession;

  Cut select(const Request& request) override;
  void resolve(Cut& cut) const override;
  std::string digest(const Cut& cut) const override;
  void prepare(const Cut& cut, render::Work& work) override;
  void draw(const Cut& cut, render::Pass& pass) override;
  int64_t resident_bytes() const override;

 private:
  struct Buffers {
    explicit Buffers(const FieldHierarchy& hierarchy, const std::vector<Gpu::Range>& ranges);

    gl::Program program;
    gl::Buffer nodes, commands, counts{sizeof(Counts)}, uniforms{sizeof(Uniforms)};
    int64_t bytes() const { return nodes.bytes() + commands.bytes() + counts.bytes() + uniforms.bytes(); }
  };
  Buffers& buffers();
  void compute(const Uniforms& uniforms, render::Work& work);
  void write(const Claim& claim, render::Work& work);

  std::optional<Buffers> buffers_;
};

Cut ComputedSession::select(const Request& request) {
  const auto selection = std::make_shared<Selection>();
  selection->uniforms = uniforms_of(make_camera(request.view), hierarchy().method.allowed(request.budget),
                                    hierarchy().node.size());
  return {request, selection, std::nullopt};
}

void ComputedSession::resolve(Cut& cut) const {
  if (cut.claim) return;
  cut.claim = claim(cut.request, [&](int honest) { return hierarchy().method.claimed(honest); });
}

std::string ComputedSession::digest(const Cut& cut) const {
  if (cut.record == nullptr) return FieldSession::digest(cut);
  const Uniforms& uniforms = static_cast<const Selection&>(*cut.record).uniforms;
  return store::digest_of(std::as_bytes(std::span(&uniforms, 1)));
}

ComputedSession::Buffers::Buffers(const FieldHierarchy& hierarchy, const std::vector<Gpu::Range>& ranges)
    : program({{{GL_COMPUTE_SHADER, "adversaries/select.comp"}}, {"LODLAB_REAL double"}, {}}),
      commands(static_cast<int64_t>(hierarchy.node.size() * sizeof(gl::DrawCommand))) {
  std::vector<GpuNode> all;
  for (size_t id = 0; id < hierarchy.node.size(); ++id) {
    const Node& node = hierarchy.node[id];
    GpuNode& on_gpu = all.emplace_back();
    for (int i = 0; i < 3; ++i) {
      on_gpu.lo[i] = node.lo[i];
      on_gpu.hi[i] = node.hi[i];
    }
    on_gpu.lo[3] = node.error[0];
    on_gpu.hi[3] = node.error[1];
    for (size_t r = 0; r < kResolutions; ++r) {
      const Gpu::Range& range = ranges[id * kResolutions + r];
      on_gpu.first[r] = range.first;
      on_gpu.count[r] = range.count;
      on_gpu.vertices = range.vertices;
    }
  }
  nodes = gl::Buffer(all);
}

ComputedSession::Buffers& ComputedSession::buffers() {
  if (!buffers_) buffers_.emplace(hierarchy(), gpu().ranges);
  return *buffers_;
}

void ComputedSession::prepare(const Cut& cut, render::Work& work) {
  if (cut.record != nullptr) {
    compute(static_cast<const Selection&>(*cut.record).uniforms, work);
  } else {
    write(*cut.claim, work);
  }
  Gpu& gpu = this->gpu();
  if (gpu.uploaded_now) work.submitted.upload_bytes += resident_bytes();
  gpu.uploaded_now = false;
}

void ComputedSession::compute(const Uniforms& uniforms, render::Work& work) {
  Buffers& on_gpu = buffers();
  on_gpu.uniforms.upload(0, std::as_bytes(std::span(&uniforms, 1)));
  work.submitted.upload_bytes += on_gpu.uniforms.bytes();
  on_gpu.program.use();
  glUniform1i(on_gpu.program.uniform("everything"), work.everything());
  glBindBufferBase(GL_UNIFORM_BUFFER, kSelectionBlock, on_gpu.uniforms.id());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kNodeBuffer, on_gpu.nodes.id());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kCommandBuffer, on_gpu.commands.id());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, kCountBuffer, on_gpu.counts.id());
  gl::Program::dispatch(1);
  work.when_done([&on_gpu](render::Submitted& submitted) {
    Counts counts;
    on_gpu.counts.read(0, std::as_writable_bytes(std::span(&counts, 1)));
    submitted.triangles += counts.triangles;
    submitted.vertices += counts.vertices;
    submitted.nodes += counts.nodes;
  });
}

void ComputedSession::write(const Claim& claim, render::Work& work) {
  std::vector<gl::DrawCommand> commands(hierarchy().node.size());
  for (const CutNode& picked : claim.nodes) {
    if (!picked.visible && !work.everything()) continue;
    const Gpu::Range& range = gpu().ranges[picked.node * kResolutions + picked.resolution];
    commands[picked.node] = {range.count, 1, range.first, 0, 0};
    work.submitted.triangles += range.count / 3;
    work.submitted.vertices += range.vertices;
    ++work.submitted.nodes;
  }
  buffers().commands.upload(0, as_bytes(commands));
  work.submitted.upload_bytes += buffers().commands.bytes();
}

void ComputedSession::draw(const Cut&, render::Pass& pass) {
  Gpu& gpu = this->gpu();
  pass.use(gpu.program, *gpu.field, {});
  gpu.array.bind();
  gl::draw_indirect(buffers().commands, 0, hierarchy().node.size(), GL_UNSIGNED_INT);
  ++pass.submitted.draw_calls;
}

int64_t ComputedSession::resident_bytes() const {
  return FieldSession::resident_bytes() + (buffers_ ? buffers_->bytes() : 0);
}

}  // namespace

std::unique_ptr<Session> computed_session(std::shared_ptr<const FieldHierarchy> hierarchy) {
  return std::make_unique<ComputedSession>(std::move(hierarchy));
}

}  // namespace lodlab::adversaries
