// SPDX-License-Identifier: MIT
// What kind of surface a mesh is, counted by indices alone (only `degenerate_triangles` looks at positions).
// Triangles that name a vertex twice lie on no edge and in no component.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "geometry/mesh.h"

namespace lodlab {

struct MeshCensus {
  int64_t components = 0;         ///< sets of triangles that are joined by vertices they share
  int64_t boundary_edges = 0;     ///< edges of one triangle
  int64_t nonmanifold_edges = 0;  ///< edges of three triangles or more
  int64_t nonmanifold_vertices =
      0;  ///< vertices round which triangles, joined across edges, make several fans
  /// The sum of the components' genera, holes closed: (2 components - boundary loops - vertices + edges -
  /// triangles) / 2. None where an edge or a vertex is not manifold, or a component has only one side.
  std::optional<int64_t> genus;
  int64_t duplicate_triangles = 0;   ///< that name the vertices of an earlier one, in either sense
  int64_t degenerate_triangles = 0;  ///< that name a vertex twice, or whose area, computed in doubles, is 0
  int64_t unused_vertices = 0;       ///< that no triangle names
  bool oriented = true;              ///< no two triangles run along an edge in the same sense
};
MeshCensus mesh_census(const MeshArrays& mesh);

/// Of the mesh as a surface: vertices at equal positions are one, but for those that a repair has split.
MeshCensus surface_census(const MeshArrays& mesh);

/// Why it is no oriented manifold, with counts; empty: it is one.
std::string manifold_faults(const MeshCensus& census);

/// Whether a triangle names a vertex twice, or its area, computed in doubles, is 0.
bool degenerate(const MeshArrays& mesh, const Face& face);

}  // namespace lodlab
