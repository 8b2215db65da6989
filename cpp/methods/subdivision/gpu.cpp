// SPDX-License-Identifier: MIT
#include "methods/subdivision/gpu.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cstring>

#include "base/errors.h"
#include "gl/error.h"
#include "gl/indirect.h"
#include "method/indirect.h"

namespace lodlab::subdivision {
namespace {

enum Binding : unsigned {
  kControl = 3,
  kFaces = 4,
  kEdges = 5,
  kState = 6,
  kSplits = 8,
  kCounts = 9,
  kIndices = 10,
  // displace.comp
  kVertexHeights = 8,
  kRanges = 9,
  kWords = 10,
  kPoints = 11,
  kPositions = 12,
};

constexpr unsigned kGroup = 64;
constexpr unsigned kMostGroups = 32768;

std::vector<std::string> defines(const SubdivisionHierarchy& hierarchy, std::string more = "") {
  const Pattern& pattern = hierarchy.pattern();
  std::vector<std::string> out = {"DOUBLINGS " + std::to_string(pattern.d),
                                  "POINTS " + std::to_string(pattern.points()),
                                  "BITS " + std::to_string(hierarchy.stored().shape.bits),
                                  "WORDS " + std::to_string((2 * pattern.n() * pattern.n() + 15) / 16)};
  if (!more.empty()) out.push_back(std::move(more));
  return out;
}

gl::Program program(const SubdivisionHierarchy& hierarchy, const char* file, std::string more = "") {
  return gl::Program({{{GL_COMPUTE_SHADER, file}}, defines(hierarchy, std::move(more)), {}});
}

void bind(unsigned binding, const gl::Buffer& buffer) {
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, binding, buffer.id());
}

unsigned groups(int64_t threads) { return static_cast<unsigned>((threads + kGroup - 1) / kGroup); }

struct ControlVertex {
  vec3 position, normal;
};

std::vector<ControlVertex> vertices_of(const std::vector<vec3>& positions, const std::vector<vec3>& normals) {
  std::vector<ControlVertex> out;
  for (size_t v = 0; v < positions.size(); ++v) out.push_back({positions[v], normals[v]});
  return out;
}

/// i, j, and the place of a point inside of a face.
std::vector<uint32_t> points_of(const Pattern& pattern) {
  std::vector<uint32_t> out;
  uint32_t inside = 0;
  const int n = pattern.n();
  for (int j = 0; j <= n; ++j) {
    for (int i = 0; i + j <= n; ++i) {
      const bool is_inside = i > 0 && j > 0 && i + j < n;
      out.push_back(static_cast<uint32_t>(i | j << 8) | (is_inside ? inside++ << 16 : 0u));
    }
  }
  return out;
}

/// A buffer is never empty.
template <class T>
gl::Buffer buffer_of(const std::vector<T>& values) {
  return values.empty() ? gl::Buffer(static_cast<int64_t>(sizeof(T))) : gl::Buffer(values);
}

}  // namespace

Gpu::Gpu(const SubdivisionHierarchy& h, bool feedback)
    : hierarchy_(h),
      faces_(h.samples().control_faces()),
      points_(h.pattern().points()),
      words_((2 * h.pattern().n() * h.pattern().n() + 15) / 16),
      most_triangles_(faces_ * h.pattern().n() * h.pattern().n()),
      surface_(render::make_surface(h.box())),
      displace_(program(h, "subdivision/displace.comp")),
      count_(program(h, "subdivision/refine.comp", "COUNT")),
      refine_(program(h, "subdivision/refine.comp")),
      place_(program(h, "subdivision/place.comp")),
      emit_(program(h, "subdivision/emit.comp")),
      draw_({{"vertex", "subdivision/draw.vert"}}, defines(h)),
      control_(vertices_of(h.rest().positions, h.rest().normals)),
      records_(h.records().face),
      edge_records_(h.records().edge),
      heights_(h.stored().packed.vertices),
      ranges_(buffer_of(h.stored().packed.ranges)),
      packed_(buffer_of(h.stored().packed.words)),
      points_table_(points_of(h.pattern())),
      positions_(faces_ * points_ * 12),
      splits_(faces_ * words_ * 4),
      counts_((faces_ + 1) * 4),
      state_(sizeof(FrameState)),
      indices_(12) {
  if (faces_ * points_ > INT32_MAX) {
    throw Unsupported("subdivision: " + std::to_string(faces_) + " control faces of " +
                      std::to_string(points_) + " points are more than 32-bit indices tell apart");
  }
  if (feedback) feedback_.emplace(defines(h));
  array_.indices(indices_);
  array_.floats(0, 0, 3, GL_FLOAT, 0);
  array_.source(0, positions_, 0, 12);
  displace();
}

void Gpu::displace() {
  displace_.use();
  bind(kControl, control_);
  bind(kFaces, records_);
  bind(kVertexHeights, heights_);
  bind(kRanges, ranges_);
  bind(kWords, packed_);
  bind(kPoints, points_table_);
  bind(kPositions, positions_);
  const auto edges = static_cast<unsigned>(edge_records_.bytes() / static_cast<int64_t>(sizeof(LineRecord)));
  glUniform1ui(displace_.uniform("faces"), static_cast<unsigned>(faces_));
  glUniform1ui(displace_.uniform("edges"), edges);
  const unsigned all = groups(faces_ * points_);
  glDispatchCompute(std::min(all, kMostGroups), (all + kMostGroups - 1) / kMostGroups, 1);
  glMemoryBarrier(GL_ALL_BARRIER_BITS);
  gl::check("placing the points of control faces");
}

void Gpu::lie(const std::shared_ptr<const Posed>& posed, render::Submitted& submitted) {
  if (posed == posed_) return;
  posed_ = posed;
  kept_.reset();
  const RestControl& rest = hierarchy_.rest();
  const auto control = posed ? vertices_of(posed->control.positions, posed->control.normals)
                             : vertices_of(rest.positions, rest.normals);
  const Records& records = posed ? posed->records : hierarchy_.records();
  const auto send_all = [&](gl::Buffer& to, std::span<const std::byte> bytes) {
    to.upload(0, bytes);
    submitted.upload_bytes += static_cast<int64_t>(bytes.size());
  };
  send_all(control_, std::as_bytes(std::span(control)));
  send_all(records_, std::as_bytes(std::span(records.face)));
  send_all(edge_records_, std::as_bytes(std::span(records.edge)));
  displace();
}

/// The frame's state, with what its passes read bound.
FrameState Gpu::begin(const Uniforms& u, const gl::Buffer& faces, const gl::Buffer& edges,
                      render::Work& work) {
  FrameState state = {};
  std::copy_n(u.eye_high, 3, state.eye_high);
  std::copy_n(u.eye_low, 3, state.eye_low);
  state.frustum = u.frustum;
  state.faces = static_cast<uint32_t>(faces_);
  state.metric = u.metric;
  state.d = u.d;
  state.low_code = u.low_code;
  state.everything = work.everything() ? 1 : 0;
  state.most = ~0u;
  if (uploaded_now_) work.submitted.upload_bytes += bytes();
  uploaded_now_ = false;
  bind(kControl, control_);
  bind(kFaces, faces);
  bind(kEdges, edges);
  bind(kState, state_);
  bind(kSplits, splits_);
  bind(kCounts, counts_);
  bind(kIndices, indices_);
  return state;
}

void Gpu::send(const FrameState& state, render::Work& work) {
  state_.upload(0, std::as_bytes(std::span(&state, 1)));
  work.submitted.upload_bytes += state_.bytes();
}

FrameState Gpu::state_now() const {
  FrameState out;
  state_.read(0, std::as_writable_bytes(std::span(&out, 1)));
  return out;
}

void Gpu::refine(const Uniforms& uniforms, const Search& search, const std::shared_ptr<const Posed>& posed,
                 render::Work& work) {
  lie(posed, work.submitted);
  FrameState state = begin(uniforms, records_, edge_records_, work);
  const Kept asked{uniforms, search.steps[0], search.most.value_or(~0u), state.everything};
  if (kept_ && std::memcmp(&*kept_, &asked, sizeof asked) == 0) {  // all is there
    work.when_done([this](render::Submitted& submitted) { submitted.triangles += state_now().triangles; });
    return;
  }
  kept_.reset();
  size_t step = 0;
  if (search.most) {
    const int64_t most = *search.most;
    FrameState in_sight = state;  // alone counts, whatever is drawn
    in_sight.everything = 0;
    step = first_that_fits(search.steps.size(), from_, [&](size_t at) {
      in_sight.step = search.steps[at];
      return count(in_sight, most, work) <= most;
    });
    if (uniforms.metric == LODLAB_METRIC_BOUND) from_ = step;
  }
  state.step = search.steps[step];
  run(state, work);
  kept_ = asked;
}

void Gpu::refine(const Uniforms& uniforms, const Records& records, render::Work& work) {
  lie(nullptr, work.submitted);
  const gl::Buffer faces(records.face), edges(records.edge);
  work.submitted.upload_bytes += faces.bytes() + edges.bytes();
  FrameState state = begin(uniforms, faces, edges, work);
  kept_.reset();
  run(state, work);
}

int64_t Gpu::count(FrameState& state, int64_t most, render::Work& work) {
  state.most = static_cast<uint32_t>(most);
  send(state, work);
  if (feedback_) {
    const Feedback::Result result = feedback_->run(faces_, most, indices_);
    work.submitted.processed += result.tested;
    return result.triangles;
  }
  count_.use();
  gl::Program::dispatch(groups(faces_));
  const FrameState after = state_now();
  work.submitted.processed += after.tested;
  return after.triangles;
}

void Gpu::run(FrameState& state, render::Work& work) {
  send(state, work);
  if (feedback_) {
    const Feedback::Result result = feedback_->run(faces_, INT64_MAX, indices_);
    work.submitted.processed += result.tested;
    work.submitted.triangles += result.triangles;
    state.triangles = static_cast<uint32_t>(result.triangles);
    state.command[0] = 3 * state.triangles;
    state.command[1] = 1;
    send(state, work);
    array_.indices(indices_);
    return;
  }
  refine_.use();
  gl::Program::dispatch(groups(faces_));
  place_.use();
  gl::Program::dispatch(1);
  make_room();
  emit_.use();
  gl::Program::dispatch(groups(faces_));
  work.when_done([this](render::Submitted& submitted) {
    const FrameState after = state_now();
    submitted.triangles += after.triangles;
    submitted.processed += after.tested;
  });
}

/// For all triangles that are left. Their number is read back only while there may be too little room.
void Gpu::make_room() {
  constexpr int64_t kTriangle = 12;
  if (indices_.bytes() >= kTriangle * most_triangles_) return;
  const int64_t bytes = kTriangle * std::max<int64_t>(state_now().triangles, 1);
  if (reserve(indices_, bytes, kTriangle * most_triangles_)) array_.indices(indices_);
  bind(kIndices, indices_);
}

void Gpu::draw(const Uniforms& uniforms, render::Pass& pass) {
  const unsigned name = pass.use(draw_, *surface_, {});
  glUniform3fv(glGetUniformLocation(name, "eye_high"), 1, uniforms.eye_high);
  glUniform3fv(glGetUniformLocation(name, "eye_low"), 1, uniforms.eye_low);
  bind(kPoints, points_table_);
  array_.bind();
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, state_.id());
  glDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT,
                         reinterpret_cast<const void*>(offsetof(FrameState, command)));  // NOLINT
  gl::check("glDrawElementsIndirect");
  ++pass.submitted.draw_calls;
}

int64_t Gpu::bytes() const {
  int64_t out = 0;
  for (const gl::Buffer* buffer : {&control_, &records_, &edge_records_, &heights_, &ranges_, &packed_,
                                   &points_table_, &positions_, &splits_, &counts_, &state_, &indices_})
    out += buffer->bytes();
  return out + (feedback_ ? feedback_->bytes() : 0);
}

}  // namespace lodlab::subdivision
