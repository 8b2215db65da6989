// SPDX-License-Identifier: MIT
#include "geometry/mesh_repair.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "base/mix.h"
#include "geometry/mesh_census.h"
#include "geometry/mesh_edges.h"

namespace lodlab {
namespace {

/// Drops the faces of which `drop` is true; how many.
template <class Drop>
int64_t drop_faces(std::vector<Face>& faces, const Drop& drop) {
  size_t kept = 0;
  for (size_t t = 0; t < faces.size(); ++t) {
    if (!drop(t)) faces[kept++] = faces[t];
  }
  const auto dropped = static_cast<int64_t>(faces.size() - kept);
  faces.resize(kept);
  return dropped;
}

/// Drops the vertices of which `keep` is 0; how many.
int64_t drop_vertices(Repaired& out, const std::vector<uint8_t>& keep) {
  std::vector<uint32_t> now(out.origin.size());
  uint32_t kept = 0;
  for (size_t v = 0; v < keep.size(); ++v) {
    now[v] = kept;
    if (keep[v]) out.origin[kept++] = out.origin[v];
  }
  const auto dropped = static_cast<int64_t>(out.origin.size() - kept);
  out.origin.resize(kept);
  for (Face& face : out.faces)
    for (uint32_t& v : face) v = now[v];
  return dropped;
}

void weld(const MeshArrays& mesh, Repaired& out) {
  const std::vector<uint32_t> first = first_at_position(mesh.positions);
  std::vector<uint8_t> keep(first.size());
  for (size_t v = 0; v < first.size(); ++v) keep[v] = first[v] == v;
  out.faces = renamed(out.faces, first);
  out.welded = drop_vertices(out, keep);
}

/// Six times the volume between triangles and the middle of their box; twice the sum of their areas, and of
/// their area vectors, which is 0 where nothing is open.
struct Enclosed {
  double volume = 0.0, area = 0.0;
  glm::dvec3 opening{0.0};
};
Enclosed enclosed(const MeshArrays& mesh, const Repaired& out) {
  Box box;
  for (const Face& face : out.faces)
    for (const uint32_t v : face) box.add(mesh.positions[out.origin[v]]);
  Enclosed sum;
  const glm::dvec3 middle = 0.5 * box.lo + 0.5 * box.hi;
  for (const Face& face : out.faces) {
    const auto corner = [&](int k) { return mesh.positions[out.origin[face[k]]] - middle; };
    const glm::dvec3 a = corner(0), normal = glm::cross(corner(1) - a, corner(2) - a);
    sum.volume += glm::dot(a, normal);
    sum.opening += normal;
    sum.area += glm::length(normal);
  }
  return sum;
}

void turn(Face& face) { std::swap(face[1], face[2]); }

void orient(const MeshArrays& mesh, Repaired& out) {
  const auto triangles = static_cast<int64_t>(out.faces.size());
  const MeshEdges edges = mesh_edges(out.faces, static_cast<int64_t>(out.origin.size()));
  Sets sets(triangles);
  for (int64_t edge = 0; edge < edges.count(); ++edge) {
    const auto sides = edges.of(edge);
    if (sides.size() != 2) continue;
    const bool same = vertex_of(out.faces, sides[0]) == vertex_of(out.faces, sides[1]);
    out.one_sided = !sets.join(sides[0] / 3, sides[1] / 3, same) || out.one_sided;
  }
  std::vector<int64_t> surplus(static_cast<size_t>(triangles), 0);  // of even triangles, at a set's lowest
  for (uint32_t t = 0; t < triangles; ++t) {
    const uint32_t set = sets.find(t);
    surplus[set] += sets.odd(t) ? -1 : 1;
  }
  for (uint32_t t = 0; t < triangles; ++t) {
    const bool few = surplus[sets.find(t)] >= 0 ? sets.odd(t) : !sets.odd(t);
    if (few) turn(out.faces[t]);
    out.turned += few;
  }
  constexpr double kOpen = 0.1;
  const Enclosed sum = enclosed(mesh, out);
  out.inside_out = sum.volume < 0.0 && glm::length(sum.opening) < kOpen * sum.area;
  if (out.inside_out)
    for (Face& face : out.faces) turn(face);
}

/// Gives the corners of each fan but a vertex's first a vertex of their own. How many were added.
int64_t split_fans(Repaired& out, const MeshEdges& edges) {
  Sets corners = fans(out.faces, edges, 2);
  const size_t before = out.origin.size();
  std::vector<uint8_t> taken(before, 0);
  std::vector<uint32_t> vertex(out.faces.size() * 3);  // of a fan, at its lowest corner
  const auto count = static_cast<uint32_t>(vertex.size());
  for (uint32_t corner = 0; corner < count; ++corner) {
    if (corners.find(corner) != corner) continue;
    const uint32_t v = vertex_of(out.faces, corner);
    const bool free = collapsed(out.faces[corner / 3]) || !taken[v];
    vertex[corner] = free ? v : static_cast<uint32_t>(out.origin.size());
    if (!free) out.origin.push_back(out.origin[v]);
    if (!collapsed(out.faces[corner / 3])) taken[v] = 1;
  }
  for (uint32_t corner = 0; corner < count; ++corner) {
    out.faces[corner / 3][corner % 3] = vertex[corners.find(corner)];
  }
  return static_cast<int64_t>(out.origin.size() - before);
}

/// Gives every triangle but two of an edge of more a vertex of its own. How many were added.
int64_t part_edges(Repaired& out, const MeshEdges& edges) {
  const size_t before = out.origin.size();
  for (int64_t edge = 0; edge < edges.count(); ++edge) {
    const auto sides = edges.of(edge);
    for (size_t i = 2; i < sides.size(); ++i) {
      uint32_t& v = out.faces[sides[i] / 3][sides[i] % 3];
      const uint32_t old = out.origin[v];
      v = static_cast<uint32_t>(out.origin.size());
      out.origin.push_back(old);
    }
  }
  return static_cast<int64_t>(out.origin.size() - before);
}

/// Fans that meet at both ends of an edge of more than two triangles leave it as it is: then its triangles
/// are parted themselves, and fans looked at again.
void split(Repaired& out) {
  for (;;) {
    const auto edges = [&] { return mesh_edges(out.faces, static_cast<int64_t>(out.origin.size())); };
    const int64_t fans_parted = split_fans(out, edges());
    const int64_t edges_parted = part_edges(out, edges());
    out.split += fans_parted + edges_parted;
    if (edges_parted == 0) return;
  }
}

void drop_unused(Repaired& out) {
  std::vector<uint8_t> keep(out.origin.size(), 0);
  for (const Face& face : out.faces)
    for (const uint32_t v : face) keep[v] = 1;
  out.unused = drop_vertices(out, keep);
}

}  // namespace

std::vector<Face> renamed(std::span<const Face> faces, std::span<const uint32_t> name) {
  std::vector<Face> out(faces.begin(), faces.end());
  for (Face& face : out)
    for (uint32_t& v : face) v = name[v];
  return out;
}

bool is_split(std::span<const Face> faces, std::span<const uint32_t> first) {
  const std::vector<Face> welded = renamed(faces, first);
  const MeshEdges edges = mesh_edges(welded, static_cast<int64_t>(first.size()));
  const auto ends = [&](uint32_t side) {
    return std::minmax({vertex_of(faces, side), vertex_of(faces, side_end(side))});
  };
  for (int64_t edge = 0; edge < edges.count(); ++edge) {
    const auto sides = edges.of(edge);
    if (sides.size() == 2 && ends(sides[0]) != ends(sides[1])) return false;
  }
  return true;
}

std::vector<uint32_t> first_at_position(std::span<const glm::dvec3> positions) {
  constexpr uint32_t kEmpty = ~uint32_t{0};
  const size_t slots = std::bit_ceil(2 * positions.size() + 1);
  std::vector<uint32_t> table(slots, kEmpty), first(positions.size());
  const auto hash = [](const glm::dvec3& p) {
    uint64_t h = 0;
    for (int k = 0; k < 3; ++k) h = mix(h + std::bit_cast<uint64_t>(p[k] + 0.0));  // -0 is 0
    return h;
  };
  for (size_t i = 0; i < positions.size(); ++i) {
    size_t slot = hash(positions[i]) & (slots - 1);
    while (table[slot] != kEmpty && positions[table[slot]] != positions[i]) slot = (slot + 1) & (slots - 1);
    if (table[slot] == kEmpty) table[slot] = static_cast<uint32_t>(i);
    first[i] = table[slot];
  }
  return first;
}

Repaired repair(const MeshArrays& mesh, const Repairs& wanted) {
  Repaired out;
  out.faces.assign(mesh.faces.begin(), mesh.faces.end());
  out.origin.resize(mesh.positions.size());
  std::iota(out.origin.begin(), out.origin.end(), 0u);
  if (wanted.weld) weld(mesh, out);
  if (wanted.degenerate) {
    out.degenerate = drop_faces(out.faces, [&](size_t t) {
      const Face& f = out.faces[t];
      return collapsed(f) || degenerate(mesh, {out.origin[f[0]], out.origin[f[1]], out.origin[f[2]]});
    });
  }
  if (wanted.duplicates) {
    const auto first = first_alike(out.faces, static_cast<int64_t>(out.origin.size()));
    out.duplicates = drop_faces(out.faces, [&](size_t t) { return first[t] != t; });
  }
  if (wanted.orient) orient(mesh, out);
  if (wanted.split) split(out);
  if (wanted.unused) drop_unused(out);
  return out;
}

}  // namespace lodlab
