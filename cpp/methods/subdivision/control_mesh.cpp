// SPDX-License-Identifier: MIT
// Edges wait in buckets by the leading bits of what their collapse costs; whether it is valid is looked at
// when its turn comes. What was refused waits until something beside it has changed.
#include "methods/subdivision/control_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <array>
#include <limits>

#include "base/errors.h"
#include "base/parallel.h"
#include "geometry/mesh_census.h"
#include "geometry/mesh_repair.h"
#include "methods/subdivision/collapse_queue.h"
#include "methods/subdivision/connectivity.h"
#include "methods/subdivision/gathered_normals.h"
#include "methods/subdivision/quadric.h"

namespace lodlab::subdivision {
namespace {

constexpr double kPointShare = 1e-4;    ///< of a plane's weight, for the point: flat parts get even triangles
constexpr double kBorderWeight = 10.0;  ///< times a border edge's squared length
constexpr size_t kMostCorners = 48;     ///< more triangles round an edge's ends: not collapsed
/// Shapes run from 0, no area, to 1, equilateral. No collapse makes triangles thinner than this and than what
/// was there.
constexpr double kThinnest = 0.05;
constexpr double kNoShape = 1e-9;
constexpr double kTurnedCost = 3;  ///< times as much, where neighbours need other axes
/// Of what poses bend (their mean), to one for the quadric at rest, whose errors displacement makes good.
constexpr double kBendWeight = 10;
constexpr float kNotWaiting = -1.0f, kRefused = -2.0f;
constexpr size_t kTellEvery = 1 << 13;

/// What is collapsed: every vertex is of a triangle, no triangle names one twice.
struct Surface {
  std::vector<glm::dvec3> positions;
  std::vector<Face> faces;
  std::vector<uint32_t> origin;  ///< the source vertex of each
};

std::vector<glm::dvec3> unit_normals(const Surface& surface) {
  std::vector<glm::dvec3> out(surface.faces.size());
  for (size_t t = 0; t < out.size(); ++t) {
    const Face& f = surface.faces[t];
    const glm::dvec3 a = surface.positions[f[0]];
    const glm::dvec3 n = glm::cross(surface.positions[f[1]] - a, surface.positions[f[2]] - a);
    const double length = glm::length(n);
    out[t] = length > 0.0 ? n / length : glm::dvec3(0.0);
  }
  return out;
}

/// The normal of a triangle, not of length 1, and its shape.
struct Shape {
  glm::dvec3 normal;
  double length, shape;
};
Shape shape_of(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const glm::dvec3 e = b - a, f = c - a, g = c - b, n = glm::cross(e, f);
  const double length = glm::length(n), edges = glm::dot(e, e) + glm::dot(f, f) + glm::dot(g, g);
  return {n, length, edges > 0.0 ? 2.0 * std::sqrt(3.0) * length / edges : 0.0};
}

class Collapser {
 public:
  /// `poses`: where the vertices are in each sample pose.
  Collapser(Surface surface, Connectivity mesh, const std::vector<std::vector<glm::dvec3>>& poses)
      : positions_(surface.positions),
        mesh_(std::move(mesh)),
        normals_(surface.faces, unit_normals(surface), static_cast<int64_t>(positions_.size()), kLeastCosine),
        left_(surface.faces.size()),
        quadrics_(positions_.size()),
        bends_(poses.size(), std::vector<BendQuadric>(positions_.size())),
        waiting_(mesh_.sides(), kNotWaiting) {
    parallel_for(static_cast<int64_t>(positions_.size()), 1 << 12, [&](int64_t first, int64_t end) {
      for (int64_t v = first; v < end; ++v) {
        quadrics_[v] = source_quadric(static_cast<uint32_t>(v));
        for (size_t p = 0; p < poses.size(); ++p)
          bends_[p][v] = source_bend(static_cast<uint32_t>(v), poses[p]);
      }
    });
    for (uint32_t side = 0; side < mesh_.sides(); ++side)
      if (mesh_.twin(side) == kNone || side < mesh_.twin(side)) enqueue(side);
  }

  /// False: no valid collapse remains.
  bool run(size_t target, const Progress& progress) {
    const size_t start = left_;
    for (size_t tried = 1; left_ > target; ++tried) {
      if (tried % kTellEvery == 0 && progress)
        progress("collapse", static_cast<double>(start - left_) / static_cast<double>(start - target));
      CollapseQueue::Entry entry;
      if (!queue_.pop(entry)) {
        if (!look_again()) return false;
        continue;
      }
      if (mesh_.gone(entry.side) || waiting_[entry.side] != entry.cost) continue;
      Collapse collapse;
      if (!valid(entry.side, collapse))
        waiting_[entry.side] = kRefused;
      else if (collapse.cost > entry.cost)
        wait(entry.side, collapse.cost);
      else
        apply(entry.side, collapse);
    }
    return true;
  }

  /// `name`: of each source vertex that of the control vertex onto which it collapsed.
  ControlMesh take(std::vector<uint32_t>& name) const {
    ControlMesh out;
    std::vector<uint32_t> kept;
    name.assign(positions_.size(), kNone);
    for (uint32_t v = 0; v < positions_.size(); ++v) {
      if (mesh_.first(v) == kNone) continue;
      normals_.each_member(v, [&](uint32_t m) { name[m] = static_cast<uint32_t>(kept.size()); });
      kept.push_back(v);
      out.positions.push_back(positions_[v]);
    }
    for (uint32_t side = 0; side < mesh_.sides(); side += 3)
      if (!mesh_.gone(side))
        out.faces.push_back({name[mesh_.from(side)], name[mesh_.to(side)], name[mesh_.apex(side)]});
    out.normals.resize(kept.size());
    parallel_for(static_cast<int64_t>(kept.size()), 16, [&](int64_t first, int64_t end) {
      for (int64_t i = first; i < end; ++i) {
        std::vector<glm::dvec3> round;
        for (uint32_t s = mesh_.first(kept[i]); s != kNone; s = mesh_.next(s))
          if (const Shape now = shape(s); now.shape > kNoShape) round.push_back(now.normal / now.length);
        out.normals[i] = normals_.middle(kept[i], round);
      }
    });
    return out;
  }

 private:
  struct Collapse {
    glm::dvec3 position{0.0};
    float cost = 0.0f;
    NormalCone cone;
    std::vector<std::pair<uint32_t, NormalCone>> turned;  ///< vertices beside it, with new axes
  };
  /// The triangles round the ends of an edge that stay, each as its side out of that end.
  struct Star {
    std::array<uint32_t, kMostCorners> sides;
    size_t count = 0, of_first = 0;
    std::span<const uint32_t> all() const { return std::span(sides).first(count); }
  };

  Shape shape(uint32_t side) const {
    return shape_of(positions_[mesh_.from(side)], positions_[mesh_.to(side)], positions_[mesh_.apex(side)]);
  }

  Quadric source_quadric(uint32_t v) const {
    Quadric q;
    double area = 0.0;
    for (uint32_t side = mesh_.first(v); side != kNone; side = mesh_.next(side)) {
      const Shape now = shape(side);
      if (now.length > 0.0) q.add_plane(now.normal / now.length, positions_[v], now.length);
      area += now.length;
      const uint32_t last = Connectivity::before(side);
      if (mesh_.twin(side) == kNone) add_border(q, side, now.normal);
      if (mesh_.twin(last) == kNone) add_border(q, last, now.normal);
    }
    q.add_point(positions_[v], kPointShare * area);
    return q;
  }
  /// How a pose moves what lies round a vertex: triangles and their unit normals, by one affine map each.
  BendQuadric source_bend(uint32_t v, const std::vector<glm::dvec3>& pose) const {
    BendQuadric q;
    for (uint32_t side = mesh_.first(v); side != kNone; side = mesh_.next(side)) {
      const Shape now = shape(side);
      if (!(now.shape > kNoShape)) continue;
      const glm::dmat3 rest = frame(side, positions_);
      const glm::dmat3 gradient = (frame(side, pose) - rest) * glm::inverse(rest);
      q.add_map(gradient, pose[v] - positions_[v] - gradient * positions_[v], now.length);
    }
    return q;
  }
  glm::dmat3 frame(uint32_t side, const std::vector<glm::dvec3>& in) const {
    const glm::dvec3& a = in[mesh_.from(side)];
    const glm::dvec3 e = in[mesh_.to(side)] - a, f = in[mesh_.apex(side)] - a, n = glm::cross(e, f);
    return {e, f, n / std::max(glm::length(n), std::numeric_limits<double>::min())};
  }
  void add_border(Quadric& q, uint32_t side, const glm::dvec3& normal) const {
    const glm::dvec3 from = positions_[mesh_.from(side)], along = positions_[mesh_.to(side)] - from;
    const glm::dvec3 across = glm::cross(along, normal);
    const double length = glm::length(across);
    if (length > 0.0) q.add_plane(across / length, from, kBorderWeight * glm::dot(along, along));
  }

  /// Where the ends of a side should meet; a border keeps its vertices when others collapse onto them.
  glm::dvec3 meeting(uint32_t side, const Quadric& sum) const {
    const uint32_t a = mesh_.from(side), b = mesh_.to(side);
    const bool border_a = mesh_.on_border(a), border_b = mesh_.on_border(b);
    if (border_a != border_b) return positions_[border_a ? a : b];
    const glm::dvec3 least = sum.least();
    const bool far = !(glm::dot(least, least) < 4.0);  // all is within 1 of the origin
    return far ? 0.5 * (positions_[a] + positions_[b]) : least;
  }
  Quadric sum_of(uint32_t side) const {
    Quadric sum = quadrics_[mesh_.from(side)];
    sum += quadrics_[mesh_.to(side)];
    for (const auto& bends : bends_) {
      BendQuadric bend = bends[mesh_.from(side)];
      bend += bends[mesh_.to(side)];
      bend.add_to(sum, kBendWeight / static_cast<double>(bends_.size()));
    }
    return sum;
  }

  void enqueue(uint32_t side) {
    if (mesh_.twin(side) != kNone) waiting_[mesh_.twin(side)] = kNotWaiting;
    const Quadric sum = sum_of(side);
    wait(side, static_cast<float>(sum.at(meeting(side, sum))));
  }
  void wait(uint32_t side, float cost) {
    waiting_[side] = cost;
    queue_.push({cost, side});
  }

  /// Tries all that were refused; false where all are again.
  bool look_again() {
    bool any = false;
    for (uint32_t side = 0; side < mesh_.sides(); ++side) {
      Collapse collapse;
      if (mesh_.gone(side) || waiting_[side] != kRefused || !valid(side, collapse)) continue;
      enqueue(side);
      any = true;
    }
    return any;
  }

  /// Whether the surface stays a manifold of its kind (the link condition); fills in the star.
  bool keeps_manifold(uint32_t side, Star& star) const {
    const uint32_t a = mesh_.from(side), b = mesh_.to(side), other = mesh_.twin(side);
    if (other != kNone && mesh_.on_border(a) && mesh_.on_border(b)) return false;
    std::array<uint32_t, kMostCorners> ring;
    size_t round = 0, common = 0;
    uint32_t before_a = kNone;  // along a border
    const auto in_edge = [&](uint32_t s) {
      return s / 3 == side / 3 || (other != kNone && s / 3 == other / 3);
    };
    for (uint32_t s = mesh_.first(a); s != kNone; s = mesh_.next(s)) {
      const uint32_t last = Connectivity::before(s);
      if (round + 2 > kMostCorners) return false;
      ring[round++] = mesh_.to(s);
      if (mesh_.twin(last) == kNone) before_a = ring[round++] = mesh_.from(last);
      if (!in_edge(s)) star.sides[star.count++] = s;
    }
    star.of_first = star.count;
    const auto seen = [&](uint32_t v) { return std::find(&ring[0], &ring[round], v) != &ring[round]; };
    for (uint32_t s = mesh_.first(b); s != kNone; s = mesh_.next(s)) {
      const uint32_t last = Connectivity::before(s);
      if (star.count == kMostCorners) return false;
      common += seen(mesh_.to(s));
      if (mesh_.twin(last) == kNone) common += seen(mesh_.from(last));
      if (!in_edge(s)) star.sides[star.count++] = s;
    }
    if (other == kNone) return common == 1 && mesh_.to(mesh_.first(b)) != before_a;  // loops keep three edges
    return common == 2 && star.count > 2;  // 2: a tetrahedron, or what is left of one
  }

  bool valid(uint32_t side, Collapse& out) const {
    Star star;
    if (!keeps_manifold(side, star)) return false;
    const Quadric sum = sum_of(side);
    const auto fits_at = [&](const glm::dvec3& at) {
      out.position = at;
      const bool fit = fits(side, star, out);
      out.cost = static_cast<float>((out.turned.empty() ? 1.0 : kTurnedCost) * sum.at(at));
      return fit;
    };
    if (fits_at(meeting(side, sum))) return true;
    const uint32_t a = mesh_.from(side), b = mesh_.to(side);
    if (mesh_.on_border(a) != mesh_.on_border(b)) return false;
    std::array<glm::dvec3, 3> others{positions_[a], positions_[b], 0.5 * (positions_[a] + positions_[b])};
    std::sort(others.begin(), others.end(),
              [&](const glm::dvec3& p, const glm::dvec3& q) { return sum.at(p) < sum.at(q); });
    return std::any_of(others.begin(), others.end(), fits_at);
  }
  bool fits(uint32_t side, const Star& star, Collapse& out) const {
    std::array<glm::dvec3, kMostCorners> buffer;
    const std::span normals = std::span(buffer).first(star.count);
    double thinnest = 1.0;
    for (size_t i = 0; i < star.count; ++i) {
      const uint32_t s = star.sides[i];
      const Shape after = shape_of(out.position, positions_[mesh_.to(s)], positions_[mesh_.apex(s)]);
      normals[i] = glm::dvec3(0.0);
      if (!(after.shape > kNoShape)) {
        if (shape(s).shape > kNoShape) return false;
        continue;
      }
      thinnest = std::min(thinnest, after.shape);
      normals[i] = after.normal / after.length;
    }
    if (thinnest < kThinnest && thinnest < thinnest_before(side, star)) return false;
    out.turned.clear();
    for (size_t i = 0; i < star.count; ++i) {
      for (const uint32_t v : {mesh_.to(star.sides[i]), mesh_.apex(star.sides[i])})
        if (!faces_along(normals[i], v) && !turn(v, side, star, normals, out)) return false;
    }
    return normals_.merge(mesh_.from(side), mesh_.to(side), normals, kLeastCosine, out.cone);
  }
  /// Seeks another axis for a vertex beside a collapse, which its triangles face along afterwards.
  bool turn(uint32_t v, uint32_t side, const Star& star, std::span<const glm::dvec3> normals,
            Collapse& out) const {
    for (const auto& [turned, cone] : out.turned)
      if (turned == v) return true;
    const uint32_t a = mesh_.from(side), b = mesh_.to(side);
    std::array<glm::dvec3, kMostCorners> round;
    size_t count = 0;
    for (size_t i = 0; i < star.count; ++i)
      if (mesh_.to(star.sides[i]) == v || mesh_.apex(star.sides[i]) == v) round[count++] = normals[i];
    for (uint32_t s = mesh_.first(v); s != kNone; s = mesh_.next(s)) {
      const auto in_edge = [&](uint32_t w) { return w == a || w == b; };
      if (in_edge(mesh_.to(s)) || in_edge(mesh_.apex(s))) continue;
      if (count == kMostCorners) return false;
      if (const Shape now = shape(s); now.shape > kNoShape) round[count++] = now.normal / now.length;
    }
    NormalCone cone;
    if (!normals_.turn(v, std::span(round).first(count), kLeastCosine, cone)) return false;
    out.turned.push_back({v, cone});
    return true;
  }
  /// Whether a normal is on a vertex's side, as far as one is known.
  bool faces_along(const glm::dvec3& normal, uint32_t v) const {
    const NormalCone& cone = normals_.cone(v);
    return cone.angle < 0.0 || normal == glm::dvec3(0.0) || glm::dot(normal, cone.axis) >= kLeastCosine;
  }
  double thinnest_before(uint32_t side, const Star& star) const {
    double thinnest = shape(side).shape;
    for (const uint32_t s : star.all()) thinnest = std::min(thinnest, shape(s).shape);
    return thinnest;
  }

  void apply(uint32_t side, const Collapse& collapse) {
    const uint32_t a = mesh_.from(side), b = mesh_.to(side);
    left_ -= mesh_.twin(side) == kNone ? 1 : 2;
    quadrics_[a] += quadrics_[b];
    for (auto& bends : bends_) bends[a] += bends[b];
    normals_.join(a, b, collapse.cone);
    for (const auto& [v, cone] : collapse.turned) normals_.give(v, cone);
    positions_[a] = collapse.position;
    mesh_.collapse(side);
    for (uint32_t s = mesh_.first(a); s != kNone; s = mesh_.next(s)) {
      enqueue(s);
      revive(mesh_.to(s));
      const uint32_t last = Connectivity::before(s);
      if (mesh_.twin(last) != kNone) continue;
      enqueue(last);
      revive(mesh_.from(last));
    }
  }
  void revive(uint32_t v) {
    for (uint32_t s = mesh_.first(v); s != kNone; s = mesh_.next(s)) {
      if (waiting_[s] == kRefused) enqueue(s);
      const uint32_t twin = mesh_.twin(s);
      if (twin != kNone && waiting_[twin] == kRefused) enqueue(twin);
    }
  }

  std::vector<glm::dvec3> positions_;
  Connectivity mesh_;
  GatheredNormals normals_;
  size_t left_;
  std::vector<Quadric> quadrics_;
  std::vector<std::vector<BendQuadric>> bends_;  ///< of each pose
  std::vector<float> waiting_;  ///< each side's cost in the queue; an edge waits by one of its sides
  CollapseQueue queue_;
};

double scale_of(const Mesh& source) {
  return 1.0 / std::max(source.extent(), std::numeric_limits<double>::min());
}

/// The triangles of a source so that neighbours in the list, and vertices numbered along it, lie near one
/// another: a fifth less time on scans.
std::vector<Face> in_order(const Mesh& source) {
  std::vector<glm::vec3> positions(source.positions.size());
  for (size_t v = 0; v < positions.size(); ++v)
    positions[v] = scale_of(source) * (source.positions[v] - source.box.center());
  std::vector<Face> out(source.faces.size());
  meshopt_spatialSortTriangles(out.data()->data(), source.faces.data()->data(), 3 * out.size(),
                               &positions.data()->x, positions.size(), sizeof(glm::vec3));
  return out;
}

/// The triangles of a source by the given names of its vertices, those that name one twice left out; vertices
/// are numbered as they are used. `name`: becomes the number.
Surface surface_of(const Mesh& source, std::span<const Face> faces, std::vector<uint32_t>& name) {
  Surface out;
  std::vector<uint32_t> number(name.size(), kNone);
  const double scale = scale_of(source);
  for (Face face : faces) {
    for (uint32_t& v : face) v = name[v];
    if (collapsed(face)) continue;
    for (uint32_t& v : face) {
      if (number[v] == kNone) {
        number[v] = static_cast<uint32_t>(out.positions.size());
        out.origin.push_back(v);
        out.positions.push_back(scale * (source.positions[v] - source.box.center()));
      }
      v = number[v];
    }
    out.faces.push_back(face);
  }
  for (uint32_t& v : name) v = number[v];
  return out;
}

/// Where the vertices of a surface are in each pose, in the units of the surface.
std::vector<std::vector<glm::dvec3>> posed(const Surface& surface, const Mesh& source, const Meshes& poses) {
  std::vector<std::vector<glm::dvec3>> out;
  for (size_t p = 0; p < poses.size(); ++p) {
    const Mesh& pose = *poses[p];
    const std::string what = "subdivision: pose " + std::to_string(p) + " of " + std::to_string(poses.size());
    if (pose.positions.size() != source.positions.size() || pose.faces.size() != source.faces.size()) {
      throw InvalidInput(what + " has " + std::to_string(pose.positions.size()) + " vertices and " +
                         std::to_string(pose.faces.size()) + " triangles; it must have the source's " +
                         std::to_string(source.positions.size()) + " and " +
                         std::to_string(source.faces.size()));
    }
    const auto [own, wanted] = std::ranges::mismatch(pose.faces, source.faces);
    if (own != pose.faces.end()) {
      const auto text = [](const Face& f) {
        return std::to_string(f[0]) + ", " + std::to_string(f[1]) + ", " + std::to_string(f[2]);
      };
      throw InvalidInput(what + " has vertices " + text(*own) + " in triangle " +
                         std::to_string(own - pose.faces.begin()) + "; it must have the source's " +
                         text(*wanted));
    }
    std::vector<glm::dvec3>& at = out.emplace_back();
    for (const uint32_t v : surface.origin)
      at.push_back(scale_of(source) * (pose.positions[v] - pose.box.center()));
  }
  return out;
}

[[noreturn]] void refuse(const Mesh& source) {
  throw InvalidInput("subdivision: the mesh must be an oriented manifold: " +
                     manifold_faults(surface_census(source)));
}

}  // namespace

ControlMesh control_mesh(const Mesh& source, int64_t target_faces, const Progress& progress,
                         const Meshes& poses) {
  if (target_faces < 1)
    throw InvalidInput("subdivision: a target of " + std::to_string(target_faces) +
                       " control faces; it must be at least 1");
  const std::vector<uint32_t> first = first_at_position(source.positions);
  std::vector<uint32_t> name = first;
  const std::vector<Face> faces = in_order(source);
  Surface surface = surface_of(source, faces, name);
  if (surface.faces.empty()) refuse(source);
  Connectivity mesh(surface.faces, static_cast<int64_t>(surface.positions.size()));
  if (!mesh.manifold()) {
    if (!is_split(source.faces, first)) refuse(source);
    for (uint32_t v = 0; v < name.size(); ++v) name[v] = v;
    surface = surface_of(source, faces, name);
    mesh = Connectivity(surface.faces, static_cast<int64_t>(surface.positions.size()));
    if (!mesh.manifold()) refuse(source);
  }
  const auto shapes = posed(surface, source, poses);
  Collapser collapser(std::move(surface), std::move(mesh), shapes);
  const bool reached = collapser.run(static_cast<size_t>(target_faces), progress);
  std::vector<uint32_t> onto;
  ControlMesh out = collapser.take(onto);
  out.reached_target = reached;
  out.centre = source.box.center();
  for (glm::dvec3& p : out.positions) p *= source.extent();
  for (uint32_t& v : name)
    if (v != kNone) v = onto[v];
  out.onto = std::move(name);
  return out;
}

}  // namespace lodlab::subdivision
