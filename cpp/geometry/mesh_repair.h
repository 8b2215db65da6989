// SPDX-License-Identifier: MIT
// Repairs, each only when asked for, in this order. No vertex moves, and each keeps what it carries.
//   weld        vertices at equal positions become the first of them
//   degenerate  triangles that name a vertex twice or have no area are left out
//   duplicates  triangles that name the vertices of an earlier one, in either sense, are left out
//   orient      neighbours across edges of two triangles run alike: in each component as most do (where no
//   one side
//               exists, as far as it goes); then all are turned if the mesh, open by less than a tenth of its
//               area, encloses a negative volume
//   split       vertices are doubled so that no edge has more than two triangles and each vertex one fan
//   (Gueziec et
//               al. 2001, cutting alone)
//   unused      vertices that no triangle names are left out
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/mesh.h"

namespace lodlab {

struct Repairs {
  bool weld = false, degenerate = false, duplicates = false, orient = false, split = false, unused = false;
};

struct Repaired {
  std::vector<uint32_t> origin;  ///< the vertex of the given mesh that each vertex was
  std::vector<Face> faces;
  int64_t welded = 0;       ///< vertices that became others
  int64_t degenerate = 0;   ///< triangles left out
  int64_t duplicates = 0;   ///< triangles left out
  int64_t turned = 0;       ///< triangles turned beside their neighbours
  bool inside_out = false;  ///< all were turned
  bool one_sided = false;   ///< some component cannot be oriented
  int64_t split = 0;        ///< vertices added
  int64_t unused = 0;       ///< vertices left out
};
Repaired repair(const MeshArrays& mesh, const Repairs& wanted);

/// For each position the first one that equals it: itself, or an earlier one.
std::vector<uint32_t> first_at_position(std::span<const glm::dvec3> positions);

/// The faces by other names of their vertices.
std::vector<Face> renamed(std::span<const Face> faces, std::span<const uint32_t> name);

/// Whether vertices at equal positions (`first`: first_at_position) are apart only where triangles do not
/// make a manifold: what a split leaves.
bool is_split(std::span<const Face> faces, std::span<const uint32_t> first);

}  // namespace lodlab
