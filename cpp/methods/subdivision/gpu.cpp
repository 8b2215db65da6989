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
  kSlots = 11,
  // displace.comp, draw.vert
  kVertexHeights = 8,
  kGroups = 9,
  kSlotHeights = 10,
  kPoints = 11,
  kPositions = 12,
};

constexpr unsigned kWorkGroup = 64;
constexpr unsigned kMostGroups = 32768;

/// Of bits for splits.
int64_t words(const Pattern& pattern) { return (2 * pattern.n() * pattern.n() + 15) / 16; }

std::vector<std::string> defines(const SubdivisionHierarchy& hierarchy, std::string more = "") {
  const Pattern& pattern = hierarchy.pattern();
  std::vector<std::string> out = {"DOUBLINGS " + std::to_string(pattern.d),
                                  "POINTS " + std::to_string(pattern.points()),
                                  "WORDS " + std::to_string(words(pattern)),
                                  "GROUP " + std::to_string(kGroupFaces), "NOWHERE 0xffffffffu"};
  if (!more.empty()) out.push_back(std::move(more));
  return out;
}

gl::Program program(const SubdivisionHierarchy& hierarchy, const char* file, std::string more = "") {
  return gl::Program({{{GL_COMPUTE_SHADER, file}}, defines(hierarchy, std::move(more)), {}});
}

void bind(unsigned binding, const gl::Buffer& buffer) {
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, binding, buffer.id());
}

unsigned groups(int64_t threads) { return static_cast<unsigned>((threads + kWorkGroup - 1) / kWorkGroup); }

struct ControlVertex {
  vec3 position, normal;
};

std::vector<ControlVertex> vertices_of(const std::vector<vec3>& positions, const std::vector<vec3>& normals) {
  std::vector<ControlVertex> out;
  for (size_t v = 0; v < positions.size(); ++v) out.push_back({positions[v], normals[v]});
  return out;
}

/// i and j of each point.
std::vector<uint32_t> points_of(const Pattern& pattern) {
  std::vector<uint32_t> out;
  for (int j = 0; j <= pattern.n(); ++j) {
    for (int i = 0; i + j <= pattern.n(); ++i) out.push_back(static_cast<uint32_t>(i | j << 8));
  }
  return out;
}

constexpr int64_t kTriangle = 12, kPosition = 12, kFloat = 4;

}  // namespace

/// Triangles of a slot's faces, as fine as they get, are twice in each of two buffers of transform feedback.
Room Gpu::room(const SubdivisionHierarchy& h, bool feedback) {
  const Pattern& pattern = h.pattern();
  const int64_t faces = h.samples().control_faces(), groups_there = groups_of(faces);
  const auto edges = static_cast<int64_t>(h.records().edge.size());
  const auto vertices = static_cast<int64_t>(h.rest().positions.size());
  const int64_t a_triangle = feedback ? 5 * kTriangle : kTriangle;
  Room out;
  out.fixed = vertices * (static_cast<int64_t>(sizeof(ControlVertex)) + kFloat) +
              faces * (static_cast<int64_t>(sizeof(FaceRecord)) + 3 * kPosition + a_triangle) +
              edges * static_cast<int64_t>(sizeof(LineRecord)) + pattern.points() * kFloat +
              groups_there * 4 + faces * words(pattern) * 4 + (faces + 1) * 4 +
              static_cast<int64_t>(sizeof(FrameState));
  out.slot = kGroupFaces *
                 (pattern.points() * (kFloat + kPosition) + int64_t{pattern.n()} * pattern.n() * a_triangle) +
             4;
  return out;
}

Gpu::Gpu(const SubdivisionHierarchy& h, bool feedback, int64_t slots)
    : hierarchy_(h),
      faces_(h.samples().control_faces()),
      slot_points_(kGroupFaces * h.pattern().points()),
      most_triangles_(faces_ + slots * kGroupFaces * h.pattern().n() * h.pattern().n()),
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
      vertex_heights_(static_cast<int64_t>(h.rest().positions.size()) * kFloat, h.stored().heights.data()),
      points_table_(points_of(h.pattern())),
      slot_of_group_(groups_of(faces_) * 4),
      group_of_slot_(std::vector<uint32_t>(static_cast<size_t>(slots), kNowhere)),
      heights_(slots * slot_points_ * kFloat),
      positions_((3 * faces_ + slots * slot_points_) * kPosition),
      splits_(faces_ * words(h.pattern()) * 4),
      counts_((faces_ + 1) * 4),
      state_(sizeof(FrameState)),
      indices_(kTriangle) {
  const int64_t points = 3 * faces_ + slots * slot_points_;
  if (points > INT32_MAX) {
    throw Unsupported("subdivision: " + std::to_string(points) +
                      " points of control faces are more than 32-bit indices tell apart");
  }
  if (feedback) feedback_.emplace(defines(h), most_triangles_);
  array_.indices(indices_);
  array_.floats(0, 0, 3, GL_FLOAT, 0);
  array_.source(0, positions_, 0, static_cast<int>(kPosition));
  displace(0, 3 * faces_);
}

void Gpu::displace(int64_t first, int64_t last) {
  displace_.use();
  bind(kControl, control_);
  bind(kFaces, records_);
  bind(kVertexHeights, vertex_heights_);
  bind(kGroups, group_of_slot_);
  bind(kSlotHeights, heights_);
  bind(kPoints, points_table_);
  bind(kPositions, positions_);
  glUniform1ui(displace_.uniform("faces"), static_cast<unsigned>(faces_));
  glUniform1ui(displace_.uniform("first"), static_cast<unsigned>(first));
  glUniform1ui(displace_.uniform("last"), static_cast<unsigned>(last));
  const unsigned all = groups(last - first);
  glDispatchCompute(std::min(all, kMostGroups), (all + kMostGroups - 1) / kMostGroups, 1);
  glMemoryBarrier(GL_ALL_BARRIER_BITS);
  gl::check("placing the points of control faces");
}

void Gpu::put(uint32_t group, int64_t slot, const Bytes& heights, render::Submitted& submitted) {
  heights_.upload(slot * slot_points_ * kFloat, heights);
  group_of_slot_.upload(slot * 4, std::as_bytes(std::span(&group, 1)));
  submitted.upload_bytes += static_cast<int64_t>(heights.size()) + 4;
  put_.push_back(slot);
}

void Gpu::lie(const std::shared_ptr<const Posed>& posed, const Records* by_hand, const Slots& slots,
              render::Submitted& submitted) {
  const auto send_all = [&](gl::Buffer& to, std::span<const std::byte> bytes) {
    to.upload(0, bytes);
    submitted.upload_bytes += static_cast<int64_t>(bytes.size());
  };
  const bool moves = posed != posed_, other_slots = slots != slots_;
  if (moves) {
    const RestControl& rest = hierarchy_.rest();
    send_all(control_, as_bytes(posed ? vertices_of(posed->control.positions, posed->control.normals)
                                      : vertices_of(rest.positions, rest.normals)));
  }
  if (other_slots) send_all(slot_of_group_, as_bytes(slots));
  if (moves || other_slots || by_hand != nullptr || records_are_by_hand_) {
    kept_.reset();
    const Records& all = by_hand != nullptr ? *by_hand : posed ? posed->records : hierarchy_.records();
    std::vector<uint8_t> there;
    for (const uint32_t slot : slots) there.push_back(slot != kNowhere ? 1 : 0);
    const bool whole = std::find(there.begin(), there.end(), 0) == there.end();
    const Records records = whole ? Records{} : held_back(all, hierarchy_.pattern().levels(), there);
    send_all(records_, as_bytes((whole ? all : records).face));
    send_all(edge_records_, as_bytes((whole ? all : records).edge));
  }
  posed_ = posed;
  slots_ = slots;
  records_are_by_hand_ = by_hand != nullptr;
  const int64_t first = 3 * faces_;
  if (moves) {
    displace(0, positions_.bytes() / kPosition);
  } else {
    std::sort(put_.begin(), put_.end());
    for (size_t i = 0, next; i < put_.size(); i = next) {  // runs of slots
      for (next = i + 1; next < put_.size() && put_[next] <= put_[next - 1] + 1;) ++next;
      displace(first + put_[i] * slot_points_, first + (put_[next - 1] + 1) * slot_points_);
    }
  }
  put_.clear();
}

/// The frame's state, with what its passes read bound.
FrameState Gpu::begin(const Uniforms& u, render::Work& work) {
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
  if (uploaded_now_)
    work.submitted.upload_bytes += control_.bytes() + vertex_heights_.bytes() + points_table_.bytes();
  uploaded_now_ = false;
  bind(kControl, control_);
  bind(kFaces, records_);
  bind(kEdges, edge_records_);
  bind(kState, state_);
  bind(kSplits, splits_);
  bind(kCounts, counts_);
  bind(kIndices, indices_);
  bind(kSlots, slot_of_group_);
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
                 const Slots& slots, render::Work& work) {
  lie(posed, nullptr, slots, work.submitted);
  FrameState state = begin(uniforms, work);
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

void Gpu::refine(const Uniforms& uniforms, const Records& records, const Slots& slots, render::Work& work) {
  lie(nullptr, &records, slots, work.submitted);
  FrameState state = begin(uniforms, work);
  state.everything = 1;  // such cuts are of no view
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
  if (indices_.bytes() >= kTriangle * most_triangles_) return;
  const int64_t bytes = kTriangle * std::max<int64_t>(state_now().triangles, 1);
  if (reserve(indices_, bytes, kTriangle * most_triangles_)) array_.indices(indices_);
  bind(kIndices, indices_);
}

void Gpu::draw(const Uniforms& uniforms, render::Pass& pass) {
  const unsigned name = pass.use(draw_, *surface_, {});
  glUniform3fv(glGetUniformLocation(name, "eye_high"), 1, uniforms.eye_high);
  glUniform3fv(glGetUniformLocation(name, "eye_low"), 1, uniforms.eye_low);
  glUniform1ui(glGetUniformLocation(name, "faces"), static_cast<unsigned>(faces_));
  bind(kGroups, group_of_slot_);
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
  for (const gl::Buffer* buffer :
       {&control_, &records_, &edge_records_, &vertex_heights_, &points_table_, &slot_of_group_,
        &group_of_slot_, &heights_, &positions_, &splits_, &counts_, &state_, &indices_})
    out += buffer->bytes();
  return out + (feedback_ ? feedback_->bytes() : 0);
}

}  // namespace lodlab::subdivision
