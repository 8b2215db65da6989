// SPDX-License-Identifier: MIT
#include "geometry/mesh_census.h"

#include <vector>

#include "geometry/mesh_edges.h"
#include "geometry/mesh_repair.h"

namespace lodlab {
namespace {

/// Counts by edges; whether the surface has two sides.
bool count_edges(const MeshArrays& mesh, const MeshEdges& edges, MeshCensus& out) {
  Sets sides_alike(static_cast<int64_t>(mesh.faces.size()));
  bool two_sided = true;
  for (int64_t edge = 0; edge < edges.count(); ++edge) {
    const auto sides = edges.of(edge);
    out.boundary_edges += sides.size() == 1;
    out.nonmanifold_edges += sides.size() > 2;
    size_t along = 0;
    for (const uint32_t side : sides)
      along += vertex_of(mesh.faces, side) < vertex_of(mesh.faces, side_end(side));
    out.oriented = out.oriented && along <= 1 && sides.size() - along <= 1;
    if (sides.size() == 2) two_sided = sides_alike.join(sides[0] / 3, sides[1] / 3, along != 1) && two_sided;
  }
  return two_sided;
}

int64_t count_fans_beyond_one(const MeshArrays& mesh, const MeshEdges& edges) {
  Sets corners = fans(mesh.faces, edges, ~size_t{0});
  std::vector<uint8_t> fans_of(mesh.positions.size(), 0);
  int64_t count = 0;
  for (uint32_t corner = 0; corner < mesh.faces.size() * 3; ++corner) {
    if (collapsed(mesh.faces[corner / 3]) || corners.find(corner) != corner) continue;
    uint8_t& known = fans_of[vertex_of(mesh.faces, corner)];
    count += known == 1;
    known = known < 2 ? known + 1 : 2;
  }
  return count;
}

/// Sets of vertices that edges join, edges of one triangle or all.
struct Joined {
  int64_t vertices = 0, sets = 0;
};
Joined joined_by(const MeshArrays& mesh, const MeshEdges& edges, bool boundary) {
  Sets sets(static_cast<int64_t>(mesh.positions.size()));
  std::vector<uint8_t> reached(mesh.positions.size(), 0);
  for (int64_t edge = 0; edge < edges.count(); ++edge) {
    if (boundary && edges.of(edge).size() != 1) continue;
    const uint32_t side = edges.of(edge)[0];
    const uint32_t a = vertex_of(mesh.faces, side), b = vertex_of(mesh.faces, side_end(side));
    sets.join(a, b);
    reached[a] = reached[b] = 1;
  }
  Joined out;
  for (uint32_t v = 0; v < reached.size(); ++v) {
    out.vertices += reached[v];
    out.sets += reached[v] != 0 && sets.find(v) == v;
  }
  return out;
}

int64_t unused(const MeshArrays& mesh) {
  std::vector<uint8_t> named(mesh.positions.size(), 0);
  for (const Face& face : mesh.faces)
    for (const uint32_t v : face) named[v] = 1;
  int64_t count = 0;
  for (const uint8_t n : named) count += n == 0;
  return count;
}

}  // namespace

bool degenerate(const MeshArrays& mesh, const Face& f) {
  const glm::dvec3& a = mesh.positions[f[0]];
  return collapsed(f) || glm::cross(mesh.positions[f[1]] - a, mesh.positions[f[2]] - a) == glm::dvec3(0.0);
}

MeshCensus mesh_census(const MeshArrays& mesh) {
  MeshCensus out;
  const auto vertices = static_cast<int64_t>(mesh.positions.size());
  const MeshEdges edges = mesh_edges(mesh.faces, vertices);
  const bool two_sided = count_edges(mesh, edges, out);
  out.nonmanifold_vertices = count_fans_beyond_one(mesh, edges);
  const Joined all = joined_by(mesh, edges, false), boundary = joined_by(mesh, edges, true);
  out.components = all.sets;
  int64_t triangles = 0;
  for (const Face& face : mesh.faces) {
    triangles += !collapsed(face);
    out.degenerate_triangles += degenerate(mesh, face);
  }
  if (two_sided && out.nonmanifold_edges == 0 && out.nonmanifold_vertices == 0) {
    out.genus = (2 * all.sets - boundary.sets - all.vertices + edges.count() - triangles) / 2;
  }
  const std::vector<uint32_t> first = first_alike(mesh.faces, vertices);
  for (size_t t = 0; t < first.size(); ++t) out.duplicate_triangles += first[t] != t;
  out.unused_vertices = unused(mesh);
  return out;
}

MeshCensus surface_census(const MeshArrays& mesh) {
  const std::vector<uint32_t> first = first_at_position(mesh.positions);
  const std::vector<Face> welded = renamed(mesh.faces, first);
  const MeshCensus census = mesh_census({mesh.positions, welded, {}, {}, nullptr});
  const bool torn = census.components > 0 && !manifold_faults(census).empty();
  return torn && is_split(mesh.faces, first) ? mesh_census(mesh) : census;
}

std::string manifold_faults(const MeshCensus& census) {
  if (census.components == 0) return "none of its triangles has corners at three positions, 0 components";
  if (census.nonmanifold_edges == 0 && census.nonmanifold_vertices == 0 && census.oriented) return {};
  return "it has " + std::to_string(census.nonmanifold_edges) + " edges of three triangles or more, " +
         std::to_string(census.nonmanifold_vertices) + " vertices of several fans, and is " +
         (census.oriented ? "" : "not ") + "oriented alike (repair=split,orient mends what has two sides)";
}

}  // namespace lodlab
