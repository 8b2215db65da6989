// SPDX-License-Identifier: MIT
#include "instrument/mesh_ruler.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include "base/errors.h"
#include "geometry/mesh_distance.h"
#include "geometry/mesh_edges.h"
#include "instrument/captured.h"
#include "instrument/crack_edges.h"
#include "instrument/crack_pixels.h"
#include "instrument/mesh_error.h"
#include "instrument/screen.h"
#include "instrument/slack.h"

namespace lodlab::instrument {
namespace {

/// A captured surface in the ruler's coordinates, with its tree and each triangle's node.
struct DrawnMesh {
  WeldedMesh mesh;
  std::vector<uint32_t> nodes;
  std::unique_ptr<MeshSurface> surface;
};

std::unique_ptr<DrawnMesh> drawn_mesh(const render::Captured& captured, const glm::dvec3& centre) {
  auto out = std::make_unique<DrawnMesh>();
  std::vector<Triangle> triangles;
  const glm::dvec3 offset = captured.eye - centre;
  const bool given = !captured.given.empty();
  for (int64_t i = 0; i < captured.triangles(); ++i) {
    check_finite(captured, i);
    const size_t first = static_cast<size_t>(3 * i);
    const render::CapturedVertex* v = &captured.vertices[first];
    if (is_filler(v)) continue;
    Triangle triangle;
    for (size_t k = 0; k < 3; ++k)
      triangle[k] = given ? captured.given[first + k] - centre : glm::dvec3(v[k].x, v[k].y, v[k].z) + offset;
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
      samples_->max = std::fmax(both.max_to_drawn, both.max_to_source);
      samples_->rms = std::fmax(both.rms_to_drawn, both.rms_to_source);
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
    return std::fmax(one_way(before(), now()), one_way(now(), before()));
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
  std::unique_ptr<DrawnMesh> made(const render::Captured& captured) const {
    try {
      return drawn_mesh(captured, ruler_.centre());
    } catch (const InvalidInput& error) {
      throw InvalidInput(shown_.drawn_by + ": " + error.what());
    }
  }
  const DrawnMesh& now() {
    if (!now_) now_ = made(shown_.now());
    return *now_;
  }
  const DrawnMesh& before() {
    if (!before_) before_ = made(shown_.before());
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

/// The nodes of what is drawn as shares of it, in the order of `parts`.
Shares shares_of(const DrawnMesh& drawn, const std::map<uint32_t, WeldedMesh>& parts, const NodeBound& bound,
                 double slack) {
  Shares out;
  std::map<uint32_t, uint32_t> place;
  for (const auto& [node, part] : parts) {
    place[node] = static_cast<uint32_t>(out.reach.size());
    out.reach.push_back(bound(node) + slack);
    out.longest = std::max(out.longest, out.reach.back());
  }
  for (const uint32_t node : drawn.nodes) out.of.push_back(place[node]);
  return out;
}

/// From what a node draws: its own distance. To it: from what of the source it is held to, where one node
/// draws all from everywhere.
std::vector<NodeError> LaidOnMesh::node_errors() {
  const DrawnMesh& drawn = now();
  const auto parts = by_node(drawn);
  std::vector<double> largest;
  if (parts.size() == 1) {
    largest.push_back(samples().max);
  } else if (!parts.empty()) {
    const MeshSurface& source = ruler_.surface();
    const double size = extent(drawn.mesh);
    const int64_t most = most_pieces(source, *drawn.surface);
    for (const auto& [node, part] : parts)
      largest.push_back(largest_distance(part, closest_to_vertices(part, source), source, size, most));
    const Shares shares = shares_of(drawn, parts, shown_.bound, ruler_.slack(shown_.camera.eye));
    largest =
        shared_distances(source.mesh(), at_source(), *drawn.surface, shares, std::move(largest), size, most);
  }
  std::vector<NodeError> out;
  for (const auto& [node, part] : parts) out.push_back({node, largest[out.size()]});
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

Orientation MeshRuler::orientation(const render::Captured& captured, const NodeBound& bound) const {
  return instrument::orientation(surface(), centre_, captured, bound);
}

bool MeshRuler::stands_free(const render::Captured& captured, const Camera& camera) const {
  return instrument::stands_free(captured, camera, glm::dvec3(0.0));
}

double MeshRuler::slack(const glm::dvec3& eye) const {
  return world_slack(reach(source_->box, eye)) + kDoubleSlack * glm::length(eye);
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
