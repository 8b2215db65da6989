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

}  // namespace lodlab
