// SPDX-License-Identifier: MIT
// The largest distance of mesh_distance.h for meshes of many triangles: most of the surface is settled
// without asking for closest points. A triangle is cut along the edges of one of the target that is near, and
// walks on over them, from triangle to triangle, until each part lies no farther from one of them than what
// was attained elsewhere. What stays open is left to the branch and bound there.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh_surface.h"

namespace lodlab {

/// For each side 3 t + k of the triangles (mesh_edges.h) the triangle on the other side; kNoTriangle where
/// there is none, or more than one.
std::vector<uint32_t> across_sides(const WeldedMesh& mesh);

/// largest_distance() within its tolerance. Fast where neighbours in the list of triangles lie near one
/// another. `across`: across_sides() of `to`.
double walked_distance(const WeldedMesh& from, const MeshSurface& to, std::span<const uint32_t> across,
                       double extent, int64_t most_pieces, double at_least = 0.0);

/// How near to a triangle of the target counts as settled: the target's triangles are in groups that follow
/// one another, each with a distance.
struct Near {
  std::span<const double> of;
  uint32_t in_a_group;

  double operator()(uint32_t triangle) const { return of[triangle / in_a_group]; }
};

/// Where a walk is: on a triangle, and which it came from.
struct WalkPlace {
  uint32_t on = kNoTriangle, before = kNoTriangle;
};

/// Walks from the triangle at `place` on over the target's triangles, and leaves in `rest` the parts of a
/// piece that are not settled on any of them, in `place` where the last part ended. Looks at no more than
/// `most_parts`: round a vertex farther than what is near, parts may turn and be cut without end.
void walk_over(const MeshSurface& to, std::span<const uint32_t> across, const Near& near,
               const Triangle& piece, WalkPlace& place, int64_t most_parts, std::vector<Triangle>& rest);

}  // namespace lodlab
