// SPDX-License-Identifier: MIT
#include "geometry/mesh_walk.h"

#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "geometry/mesh_distance.h"
#include "geometry/mesh_edges.h"

namespace lodlab {
namespace {

/// Triangles that a piece may walk over.
constexpr int kMostSteps = 24;

constexpr int64_t kAnyParts = std::numeric_limits<int64_t>::max();

/// Of so many triangles one has its first corner measured first, for a distance that most others do not
/// exceed.
constexpr int64_t kFirstOf = 16;

/// Triangles that one thread takes at a time: the figures depend on it, and on no number of threads.
constexpr int64_t kBlock = 256;

/// A target triangle with what tells on which side of its edges, and how far, a point is.
struct Tile {
  Triangle t;
  glm::dvec3 normal;
  double square;                  ///< of the normal's length
  std::array<glm::dvec3, 3> out;  ///< across each edge, in the triangle's plane
  bool flat;

  explicit Tile(const Triangle& of) : t(of), normal(glm::cross(t[1] - t[0], t[2] - t[0])) {
    square = glm::dot(normal, normal);
    const glm::dvec3 ab = t[1] - t[0], ac = t[2] - t[0];
    flat = !(square > kFlattest * kFlattest * glm::dot(ab, ab) * glm::dot(ac, ac));
    for (size_t i = 0; i < 3; ++i) out[i] = glm::cross(t[(i + 1) % 3] - t[i], normal);
  }
  /// The squared distance of a point; `beyond` how far it is past each edge, times the length of `out`.
  double squared(const glm::dvec3& point, std::array<double, 3>& beyond) const {
    for (size_t i = 0; i < 3; ++i) beyond[i] = glm::dot(point - t[i], out[i]);
    double best = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < 3; ++i) {
      if (!(beyond[i] > 0.0)) continue;
      const glm::dvec3 along = t[(i + 1) % 3] - t[i], from = point - t[i];
      const double share = std::clamp(glm::dot(from, along) / glm::dot(along, along), 0.0, 1.0);
      const glm::dvec3 gap = from - share * along;
      best = std::min(best, glm::dot(gap, gap));
    }
    if (best < std::numeric_limits<double>::infinity()) return best;
    const double height = glm::dot(point - t[0], normal);
    return height * height / square;
  }
};

/// What stays the same during a walk.
struct Walk {
  const MeshSurface& to;
  std::span<const uint32_t> across;
  const Near& near;
  std::vector<Triangle>& rest;
  int64_t parts_left;

  void go(const Triangle& piece, WalkPlace& place, int steps);
};

/// Cuts a piece along the edges of the triangle that it is on and walks on over them with what is past.
void Walk::go(const Triangle& piece, WalkPlace& place, int steps) {
  if (parts_left-- <= 0) return rest.push_back(piece);
  const WalkPlace here = place;
  const Tile tile(to.mesh().triangle(here.on));
  if (tile.flat) return rest.push_back(piece);
  const double near_here = near(here.on);
  std::array<std::array<double, 3>, 3> beyond;
  double most = 0.0;
  size_t worst = 0;
  for (size_t k = 0; k < 3; ++k) {
    const double squared = tile.squared(piece[k], beyond[k]);
    if (!(squared <= most)) most = squared, worst = k;
  }
  if (most <= near_here * near_here) return;
  double farthest = 0.0;
  size_t side = 0;
  for (size_t i = 0; i < 3; ++i) {
    const double far = beyond[worst][i] / glm::length(tile.out[i]);
    if (far > farthest) farthest = far, side = i;
  }
  if (!(farthest > 0.0) || steps == 0) return rest.push_back(piece);
  const WalkPlace next{across[3 * size_t{here.on} + side], here.on};
  const bool stuck = next.on == kNoTriangle || next.on == here.before;
  const auto on = [&](const Triangle& part, bool past) {
    if (past && stuck) return rest.push_back(part);
    place = past ? next : here;
    go(part, place, steps - 1);
  };
  const auto past = [&](size_t k) { return beyond[k][side] > 0.0; };
  const int count = past(0) + past(1) + past(2);
  if (count == 3) return on(piece, true);
  size_t lone = 0;
  while (past(lone) != (count == 1)) ++lone;
  const size_t p = (lone + 1) % 3, q = (lone + 2) % 3;
  const auto crossing = [&](size_t end) {
    return glm::mix(piece[lone], piece[end], beyond[lone][side] / (beyond[lone][side] - beyond[end][side]));
  };
  const glm::dvec3 at_p = crossing(p), at_q = crossing(q);
  const bool tip_past = count == 1;
  if (!tip_past) on({piece[lone], at_p, at_q}, false);
  on({piece[p], at_q, at_p}, !tip_past);
  on({piece[p], piece[q], at_q}, !tip_past);
  if (tip_past) on({piece[lone], at_p, at_q}, true);
}

/// One thread's way over the target.
struct Walker {
  const MeshSurface& to;
  std::span<const uint32_t> across;
  double absolute;
  double attained;                ///< the largest distance that is known
  uint32_t last = kNoTriangle;    ///< where the triangle before was near
  std::vector<Triangle> open;     ///< parts that nothing settles
  std::vector<Triangle> parts{};  ///< of the triangle at hand

  /// The largest upper bound that says no more than what is attained, less a hair.
  double settled() const {
    return std::max(attained * (1.0 + kMaxTolerance), attained + absolute) * (1.0 - 1e-12);
  }
  void triangle(const Triangle& whole);
  void ask(const glm::dvec3& point) {
    const Closest closest = to.closest(point, last);
    attained = std::max(attained, closest.distance);
    last = closest.triangle;
  }
};

glm::dvec3 centre_of(const Triangle& t) { return (t[0] + t[1] + t[2]) / 3.0; }

void Walker::triangle(const Triangle& whole) {
  const auto go = [&](const Triangle& piece, std::vector<Triangle>& left) {
    WalkPlace place{last};
    const double near = settled();
    walk_over(to, across, {{&near, 1}, kNoTriangle}, piece, place, kAnyParts, left);
    last = place.on;
  };
  if (last != kNoTriangle) {
    const glm::dvec3 centre = centre_of(whole);
    double radius = 0.0;
    for (const glm::dvec3& corner : whole) radius = std::max(radius, glm::distance(corner, centre));
    const double near = closest_on_triangle(to.mesh().triangle(last), centre).distance;
    if (near + radius <= settled()) return;  // most are
    parts.clear();
    go(whole, parts);
  } else {
    parts = {whole};
  }
  for (const Triangle& part : parts) {
    ask(centre_of(part));
    go(part, open);
  }
}

/// Triangles that share nothing.
WeldedMesh loose(const std::vector<Triangle>& triangles) {
  WeldedMesh out;
  for (const Triangle& t : triangles) {
    const auto first = static_cast<uint32_t>(out.positions.size());
    out.positions.insert(out.positions.end(), t.begin(), t.end());
    out.faces.push_back({first, first + 1, first + 2});
  }
  return out;
}

}  // namespace

std::vector<uint32_t> across_sides(const WeldedMesh& mesh) {
  const MeshEdges edges = mesh_edges(mesh.faces, static_cast<int64_t>(mesh.positions.size()));
  std::vector<uint32_t> out(3 * mesh.faces.size(), kNoTriangle);
  for (int64_t e = 0; e < edges.count(); ++e) {
    const std::span<const uint32_t> sides = edges.of(e);
    if (sides.size() != 2) continue;
    out[sides[0]] = sides[1] / 3;
    out[sides[1]] = sides[0] / 3;
  }
  return out;
}

void walk_over(const MeshSurface& to, std::span<const uint32_t> across, const Near& near,
               const Triangle& piece, WalkPlace& place, int64_t most_parts, std::vector<Triangle>& rest) {
  Walk{to, across, near, rest, most_parts}.go(piece, place, kMostSteps);
}

double walked_distance(const WeldedMesh& from, const MeshSurface& to, std::span<const uint32_t> across,
                       double extent, int64_t most_pieces, double at_least) {
  const int64_t count = from.triangles(), blocks = (count + kBlock - 1) / kBlock;
  std::vector<Walker> walkers(static_cast<size_t>(blocks),
                              Walker{to, across, kLeastShare * extent, at_least, kNoTriangle, {}});
  const auto for_blocks = [&](const auto& body) {
    parallel_for(blocks, 1, [&](int64_t begin, int64_t end) {
      for (int64_t block = begin; block < end; ++block)
        body(walkers[static_cast<size_t>(block)], block * kBlock, std::min(count, (block + 1) * kBlock));
    });
    double most = at_least;
    for (const Walker& walker : walkers) most = std::max(most, walker.attained);
    for (Walker& walker : walkers) walker.attained = most;
    return most;
  };
  for_blocks([&](Walker& walker, int64_t first, int64_t end) {
    for (int64_t i = first; i < end; i += kFirstOf) walker.ask(from.triangle(i)[0]);
    walker.last = kNoTriangle;
  });
  const double most = for_blocks([&](Walker& walker, int64_t first, int64_t end) {
    for (int64_t i = first; i < end; ++i) walker.triangle(from.triangle(i));
  });
  std::vector<Triangle> open;
  for (const Walker& walker : walkers) open.insert(open.end(), walker.open.begin(), walker.open.end());
  if (open.empty()) return most;
  const WeldedMesh rest = loose(open);
  return largest_distance(rest, closest_to_vertices(rest, to), to, extent, most_pieces, most);
}

}  // namespace lodlab
