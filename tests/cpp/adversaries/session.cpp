// SPDX-License-Identifier: MIT
// Selection and drawing of the family. All nodes of a cut have one resolution: the coarser where its
// predicted error is within the budget, else the finer where the hard budgets allow it.
#include <epoxy/gl.h>

#include <algorithm>

#include "base/errors.h"
#include "common/projection.h"
#include "gl/error.h"
#include "gpu.h"

namespace lodlab::adversaries {
namespace {

Box box_of(const Node& node) {
  return {{node.lo[0], node.lo[1], node.lo[2]}, {node.hi[0], node.hi[1], node.hi[2]}};
}

bool same(const View& a, const View& b) {
  return a.eye == b.eye && a.target == b.target && a.up == b.up && a.fov == b.fov && a.width == b.width &&
         a.height == b.height && a.near_plane == b.near_plane;
}

}  // namespace

void FamilySession::add(Claim& claim, int64_t id, int resolution, bool visible) const {
  const Node& node = nodes_->node[static_cast<size_t>(id)];
  CutNode picked;
  picked.node = static_cast<uint32_t>(id);
  picked.resolution = static_cast<uint32_t>(resolution);
  picked.visible = visible;
  picked.error = node.error[resolution];
  claim.nodes.push_back(picked);
  if (!visible) return;
  claim.triangles += node.triangles[resolution];
  claim.filler_triangles += node.fillers[resolution];
  ++claim.visible_nodes;
}

Claim FamilySession::uniform(const View& view, int resolution) const {
  const Camera camera = make_camera(view);
  Claim claim;
  for (size_t id = 0; id < nodes_->node.size(); ++id) {
    const Node& node = nodes_->node[id];
    const bool visible = camera.sees(box_of(node));
    add(claim, static_cast<int64_t>(id), resolution, visible);
    if (!visible) continue;
    const double px = project_strict(node.error[resolution], camera.K, distance(box_of(node), camera.eye),
                                     camera.near_plane, camera.s, 1.0);
    claim.predicted_px = std::max(claim.predicted_px, px);
  }
  return claim;
}

Claim FamilySession::claim(const Request& request, const std::function<int(int)>& pick) const {
  const Budget allowed = nodes_->method.allowed(request.budget);
  Claim claims[kResolutions] = {uniform(request.view, 0), uniform(request.view, 1)};
  const int honest =
      (allowed.pixel_error && claims[0].within(allowed)) || !claims[1].within_hard(allowed) ? 0 : 1;
  Claim& claim = claims[pick(honest)];
  claim.tau = request.budget.pixel_error.value_or(claim.predicted_px);
  claim.budget_met = claim.within(allowed);
  if (!claims[0].within_hard(allowed)) {
    claim.least_triangles = claims[0].triangles;
    claim.least_nodes = claims[0].visible_nodes;
  }
  return std::move(claim);
}

Cut FamilySession::select(const Request& request) {
  const bool again = view_ && same(*view_, request.view);
  view_ = request.view;
  return {request, nullptr, claim(request, [&](int honest) {
            return resolution_ = nodes_->method.choose(honest, resolution_, again);
          })};
}

void FamilySession::reset() {
  view_.reset();
  resolution_ = -1;
}

Cut FamilySession::cut(const std::vector<int64_t>& nodes, const std::vector<int32_t>& resolutions) const {
  const size_t count = nodes_->node.size();
  std::vector<int> picked(count, -1);
  if (!resolutions.empty() && resolutions.size() != nodes.size())
    throw InvalidInput("cut: as many resolutions as nodes are needed, or none");
  for (size_t i = 0; i < nodes.size(); ++i) {
    const int resolution = resolutions.empty() ? 0 : resolutions[i];
    const std::string name = "cut: node " + std::to_string(nodes[i]);
    if (nodes[i] < 0 || nodes[i] >= static_cast<int64_t>(count))
      throw InvalidInput(name + " is not within 0 to " + std::to_string(count - 1));
    if (resolution < 0 || resolution >= kResolutions)
      throw InvalidInput(name + " has no resolution " + std::to_string(resolution));
    int& place = picked[static_cast<size_t>(nodes[i])];
    if (place >= 0) throw InvalidInput(name + " is given twice");
    place = resolution;
  }
  Claim claim;
  for (size_t id = 0; id < count; ++id) {
    if (picked[id] < 0) throw InvalidInput("cut: gap: node " + std::to_string(id) + " is missing");
    add(claim, static_cast<int64_t>(id), picked[id], true);
  }
  return cut_by_hand(std::move(claim));
}

/// A node has one surface per resolution, whatever its neighbours are.
std::vector<Cut> FamilySession::audit_cuts() const {
  std::vector<int64_t> all(nodes_->node.size());
  for (size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int64_t>(i);
  std::vector<Cut> out;
  for (int32_t r = 0; r < kResolutions; ++r) out.push_back(cut(all, std::vector<int32_t>(all.size(), r)));
  return out;
}

void FamilySession::draw(const Cut& cut, render::Pass& pass) {
  begin(pass);
  for (const CutNode& picked : cut.claim->nodes) {
    if (!picked.visible && !pass.everything()) continue;
    const int resolution = nodes_->method.drawn(static_cast<int>(picked.resolution), pass);
    if (resolution >= 0) draw_node(picked.node, resolution, pass);
  }
  gl::check("drawing an adversary");
}

FieldSession::Gpu::Gpu(const FieldHierarchy& hierarchy)
    : field(render::make_surface(hierarchy.frame, hierarchy.coverage)) {
  std::vector<Vertex> all;
  std::vector<uint32_t> corners;
  for (size_t id = 0; id < hierarchy.node.size(); ++id) {
    for (int resolution = 0; resolution < kResolutions; ++resolution) {
      const Mesh mesh = make_mesh(hierarchy.method, hierarchy.frame, hierarchy.heights.data(), hierarchy.gap,
                                  static_cast<int64_t>(id), resolution);
      ranges.push_back({static_cast<uint32_t>(corners.size()), static_cast<uint32_t>(mesh.indices.size()),
                        static_cast<uint32_t>(mesh.vertices.size())});
      for (const uint32_t index : mesh.indices) corners.push_back(static_cast<uint32_t>(all.size()) + index);
      all.insert(all.end(), mesh.vertices.begin(), mesh.vertices.end());
    }
  }
  vertices = gl::Buffer(all);
  indices = gl::Buffer(corners);
  array.integers(0, 0, 2, GL_UNSIGNED_INT, offsetof(Vertex, col));
  array.floats(1, 0, 1, GL_FLOAT, offsetof(Vertex, height));
  array.integers(2, 0, 2, GL_UNSIGNED_INT, offsetof(Vertex, node));
  array.source(0, vertices, 0, sizeof(Vertex));
  array.indices(indices);
}

FieldSession::FieldSession(std::shared_ptr<const FieldHierarchy> hierarchy)
    : FamilySession(hierarchy), hierarchy_(std::move(hierarchy)) {}

FieldSession::~FieldSession() = default;

std::unique_ptr<Session> Family::session(std::shared_ptr<const FieldHierarchy> hierarchy) const {
  return std::make_unique<FieldSession>(std::move(hierarchy));
}

FieldSession::Gpu& FieldSession::gpu() {
  if (!gpu_) gpu_ = std::make_unique<Gpu>(*hierarchy_);
  return *gpu_;
}

void FieldSession::begin(render::Pass& pass) {
  Gpu& gpu = this->gpu();
  pass.use(gpu.program, *gpu.field, {});
  gpu.array.bind();
  if (gpu.uploaded_now) pass.submitted.upload_bytes += resident_bytes();
  gpu.uploaded_now = false;
}

void FieldSession::draw_node(uint32_t node, int resolution, render::Pass& pass) {
  const Gpu::Range& range = gpu().ranges[node * kResolutions + static_cast<size_t>(resolution)];
  glDrawElements(GL_TRIANGLES, static_cast<GLsizei>(range.count), GL_UNSIGNED_INT,
                 reinterpret_cast<const void*>(sizeof(uint32_t) * static_cast<size_t>(range.first)));
  pass.submitted.triangles += hierarchy().node[node].triangles[resolution];
  pass.submitted.filler_triangles += hierarchy().node[node].fillers[resolution];
  pass.submitted.vertices += range.vertices;
  ++pass.submitted.nodes;
  ++pass.submitted.draw_calls;
}

int64_t FieldSession::resident_bytes() const { return gpu_ ? gpu_->bytes() : 0; }

}  // namespace lodlab::adversaries
