// SPDX-License-Identifier: MIT
#include "instrument/mesh_ruler.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/mesh_distance.h"
#include "instrument/crack_edges.h"
#include "instrument/crack_pixels.h"
#include "instrument/mesh_error.h"
#include "instrument/screen.h"
#include "instrument/slack.h"

namespace lodlab::instrument {
namespace {

double larger(double a, double b) { return std::isnan(a) || b > a ? b : a; }

bool is_filler(const render::CapturedVertex* v) { return ((v[0].bits | v[1].bits | v[2].bits) & 1u) != 0; }

/// A captured surface in the ruler's coordinates, with its tree and each triangle's node.
struct DrawnMesh {
  WeldedMesh mesh;
  std::vector<uint32_t> nodes;
  std::unique_ptr<MeshSurface> surface;
};

std::unique_ptr<DrawnMesh> drawn_mesh(const render::Captured& captured, const glm::dvec3& centre,
                                      const std::string& drawn_by) {
  auto out = std::make_unique<DrawnMesh>();
  std::vector<Triangle> triangles;
  const glm::dvec3 offset = captured.eye - centre;
  for (int64_t i = 0; i < captured.triangles(); ++i) {
    const render::CapturedVertex* v = &captured.vertices[static_cast<size_t>(3 * i)];
    Triangle triangle;
    for (size_t k = 0; k < 3; ++k) {
      triangle[k] = glm::dvec3(v[k].x, v[k].y, v[k].z) + offset;
      if (std::isfinite(v[k].x) && std::isfinite(v[k].y) && std::isfinite(v[k].z)) continue;
      throw InvalidInput(drawn_by + ": measure: node " + std::to_string(v[k].node) + " drew vertex " +
                         std::to_string(3 * i + static_cast<int64_t>(k)) + " at (" + std::to_string(v[k].x) +
                         ", " + std::to_string(v[k].y) + ", " + std::to_string(v[k].z) +
                         "); positions must be finite");
    }
    if (is_filler(v)) continue;
    triangles.push_back(triangle);
    out->nodes.push_back(v[0].node);
  }
  out->mesh = weld(triangles, glm::dvec3(0.0));
  out->surface = std::make_unique<MeshSurface>(out->mesh);
  return out;
}

/// The faces of each node, as meshes of their own.
std::map<uint32_t, WeldedMesh> by_node(const DrawnMesh& drawn) {
  std::map<uint32_t, WeldedMesh> out;
  for (size_t i = 0; i < drawn.nodes.size(); ++i) out[drawn.nodes[i]].faces.push_back(drawn.mesh.faces[i]);
  for (auto& [node, part] : out) {
    std::vector<uint32_t> used;
    for (const auto& face : part.faces) used.insert(used.end(), face.begin(), face.end());
    std::sort(used.begin(), used.end());
    used.erase(std::unique(used.begin(), used.end()), used.end());
    for (const uint32_t vertex : used) part.positions.push_back(drawn.mesh.positions[vertex]);
    for (auto& face : part.faces) {
      for (uint32_t& vertex : face)
        vertex = static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), vertex) - used.begin());
    }
  }
  return out;
}

class LaidOnMesh final : public Laid {
 public:
  LaidOnMesh(const MeshRuler& ruler, Shown shown) : ruler_(ruler), shown_(std::move(shown)) {}

  const SampleError& samples() override {
    if (!samples_) {
      const TwoSided both = two_sided();
      samples_.emplace();
      samples_->max = larger(both.max_to_drawn, both.max_to_source);
      samples_->rms = larger(both.rms_to_drawn, both.rms_to_source);
      samples_->samples = ruler_.source().samples();
    }
    return *samples_;
  }
  TwoSided two_sided() override {
    if (!two_sided_)
      two_sided_ = instrument::two_sided(ruler_.surface(), *now().surface, at_source(), extent(now().mesh));
    return *two_sided_;
  }
  double px_max() override {
    return vertex_error_px(ruler_.surface().mesh(), at_source(), shown_.camera, offset());
  }
  /// Over the vertices of both drawn surfaces.
  double jump_px_max() override {
    if (!shown_.before) return kUndefined;
    const auto one_way = [&](const DrawnMesh& from, const DrawnMesh& to) {
      return vertex_error_px(from.mesh, closest_to_vertices(from.mesh, *to.surface), shown_.camera, offset());
    };
    return larger(one_way(before(), now()), one_way(now(), before()));
  }
  std::vector<NodeError> node_errors() override;
  std::optional<int64_t> raised_fillers() override { return std::nullopt; }
  Correspondence to_drawn() override { return closest_on(*now().surface); }
  Correspondence to_drawn_before() override {
    if (!shown_.before) return {};
    return closest_on(*before().surface);
  }
  Correspondence to_source() override { return closest_on(ruler_.surface()); }

 private:
  glm::dvec3 offset() const { return ruler_.centre() - shown_.camera.eye; }

  Correspondence closest_on(const MeshSurface& surface) const {
    return [&surface, offset = offset()](std::span<const glm::dvec3> points, std::span<glm::dvec3> out) {
      uint32_t hint = kNoTriangle;
      for (size_t i = 0; i < points.size(); ++i) {
        const Closest closest = surface.closest(points[i] - offset, hint);
        hint = closest.triangle;
        out[i] = closest.distance == 0.0 ? points[i] : closest.point + offset;  // NaN where nothing is
      }
    };
  }
  double extent(const WeldedMesh& drawn) const {
    Box box;
    for (const WeldedMesh* mesh : {&ruler_.surface().mesh(), &drawn}) {
      for (const glm::dvec3& p : mesh->positions) box.add(p);
    }
    return glm::distance(box.lo, box.hi);
  }
  const DrawnMesh& now() {
    if (!now_) now_ = drawn_mesh(shown_.now(), ruler_.centre(), shown_.drawn_by);
    return *now_;
  }
  const DrawnMesh& before() {
    if (!before_) before_ = drawn_mesh(shown_.before(), ruler_.centre(), shown_.drawn_by);
    return *before_;
  }
  /// The closest drawn point of each vertex of the source.
  const std::vector<Closest>& at_source() {
    if (!at_source_) at_source_ = closest_to_vertices(ruler_.surface().mesh(), *now().surface);
    return *at_source_;
  }

  const MeshRuler& ruler_;
  Shown shown_;
  std::unique_ptr<DrawnMesh> now_, before_;
  std::optional<std::vector<Closest>> at_source_;
  std::optional<SampleError> samples_;
  std::optional<TwoSided> two_sided_;
};

/// From what a node draws: its own distance. To it: from the source's vertices that are closest to it; where
/// one node draws all, from everywhere.
std::vector<NodeError> LaidOnMesh::node_errors() {
  const DrawnMesh& drawn = now();
  std::map<uint32_t, double> largest;
  const auto parts = by_node(drawn);
  if (parts.size() == 1) {
    largest[parts.begin()->first] = samples().max;
  } else {
    for (const auto& [node, part] : parts) {
      const auto there = closest_to_vertices(part, ruler_.surface());
      const int64_t most = int64_t{1} << 24;
      largest[node] = surface_distance(part, there, ruler_.surface(), extent(drawn.mesh), most).max;
    }
    for (const Closest& closest : at_source()) {
      double& seen = largest[drawn.nodes[closest.triangle]];
      seen = std::max(seen, closest.distance);
    }
  }
  std::vector<NodeError> out;
  for (const auto& [node, max] : largest) out.push_back({node, max});
  return out;
}

/// The edges of a mesh that are not there once in each direction, but for those of triangles that are
/// segments.
WeldedMesh unmatched_edges(const WeldedMesh& mesh) {
  struct Edge {
    uint32_t low, high;
    bool forward;
    auto operator<=>(const Edge&) const = default;
  };
  std::vector<Edge> edges;
  edges.reserve(3 * mesh.faces.size());
  for (const auto& face : mesh.faces) {
    if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) continue;
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t a = face[k], b = face[(k + 1) % 3];
      edges.push_back({std::min(a, b), std::max(a, b), a < b});
    }
  }
  std::sort(edges.begin(), edges.end());
  WeldedMesh out;
  out.positions = mesh.positions;
  for (size_t i = 0; i < edges.size();) {
    size_t next = i, forward = 0;
    for (; next < edges.size() && edges[next].low == edges[i].low && edges[next].high == edges[i].high;
         ++next)
      forward += edges[next].forward ? 1 : 0;
    if (next - i != 2 || forward != 1) out.faces.push_back({edges[i].low, edges[i].high, edges[i].high});
    i = next;
  }
  return out;
}

}  // namespace

MeshRuler::MeshRuler(std::shared_ptr<const Mesh> source) : source_(std::move(source)) {
  if (source_ == nullptr) throw InvalidInput("instrument: no source to measure against");
  centre_ = source_->box.center();
}

const MeshSurface& MeshRuler::surface() const {
  std::call_once(welded_once_, [&] {
    std::vector<Triangle> triangles(source_->faces.size());
    for (size_t i = 0; i < triangles.size(); ++i) {
      for (size_t k = 0; k < 3; ++k) triangles[i][k] = source_->positions[source_->faces[i][k]];
    }
    welded_ = weld(triangles, centre_);
    surface_ = std::make_unique<MeshSurface>(welded_);
  });
  return *surface_;
}

const MeshSurface& MeshRuler::border() const {
  surface();
  std::call_once(border_once_, [&] {
    segments_ = unmatched_edges(welded_);
    border_ = std::make_unique<MeshSurface>(segments_);
  });
  return *border_;
}

std::unique_ptr<Laid> MeshRuler::lay(Shown shown) const {
  return std::make_unique<LaidOnMesh>(*this, std::move(shown));
}

int64_t MeshRuler::crack_edges(const render::Captured& captured, const NodeBound& bound) const {
  const glm::dvec3 offset = captured.eye - centre_;
  return instrument::crack_edges(captured, [&](const UnmatchedEdge& edge) {
    if (edge.balanced) return true;
    const double bound_of_node = bound(edge.node);
    for (const glm::dvec3& point : {edge.low, edge.high, 0.5 * (edge.low + edge.high)}) {
      const double reach = bound_of_node + world_slack(glm::length(point));
      if (!(border().closest(point + offset).distance <= reach)) return false;
    }
    return true;
  });
}

bool MeshRuler::stands_free(const render::Captured& captured, const Camera& camera) const {
  return instrument::stands_free(captured, camera, glm::dvec3(0.0));
}

double MeshRuler::slack(const glm::dvec3& eye) const {
  const glm::dvec3 far = glm::max(glm::abs(source_->box.lo - eye), glm::abs(source_->box.hi - eye));
  return world_slack(glm::length(far)) + kDoubleSlack * glm::length(eye);
}

/// Beyond, what is drawn is off by more than a thousandth of the whole mesh.
void MeshRuler::check_near(const glm::dvec3& eye) const {
  const double off = slack(eye), most = 1e-3 * source_->extent();
  if (off <= most) return;
  char text[256];
  std::snprintf(
      text, sizeof text,
      "measure: the eye is so far from the mesh that 32-bit positions relative to it are up to %.4g off "
      "(limit: %.4g, a thousandth of its extent)",
      off, most);
  throw InvalidInput(text);
}

}  // namespace lodlab::instrument
