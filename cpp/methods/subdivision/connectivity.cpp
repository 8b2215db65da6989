// SPDX-License-Identifier: MIT
#include "methods/subdivision/connectivity.h"

namespace lodlab::subdivision {

Connectivity::Connectivity(std::span<const Face> faces, int64_t vertices)
    : from_(3 * faces.size()), twin_(from_.size(), kNone), first_(static_cast<size_t>(vertices), kNone) {
  const MeshEdges edges = mesh_edges(faces, vertices);
  for (uint32_t side = 0; side < from_.size(); ++side) from_[side] = vertex_of(faces, side);
  for (int64_t edge = 0; edge < edges.count(); ++edge) {
    const auto sides = edges.of(edge);
    if (sides.size() == 1) continue;
    manifold_ = manifold_ && sides.size() == 2 && from_[sides[0]] != from_[sides[1]];
    twin_[sides[0]] = sides[1];
    twin_[sides[1]] = sides[0];
  }
  for (uint32_t side = 0; side < from_.size(); ++side) {
    uint32_t& first = first_[from_[side]];
    if (first == kNone || twin_[side] == kNone) first = side;
  }
  if (!manifold_) return;
  size_t reached = 0;
  for (const uint32_t first : first_)
    for (uint32_t side = first; side != kNone; side = next(side)) ++reached;
  manifold_ = reached == from_.size();
}

void Connectivity::collapse(uint32_t side) {
  const uint32_t other = twin_[side], kept = from_[side], gone = to(side);
  for (uint32_t out = first_[gone]; out != kNone;) {
    const uint32_t following = next(out);
    from_[out] = kept;
    out = following;
  }
  // `next` compares with the first side of the vertex's new name: renamed ones are done with.
  const uint32_t inner = twin_[before(side)], outer = twin_[side_end(side)];
  close(side);
  if (other != kNone) close(other);
  find_first(inner != kNone ? inner : side_end(outer));
  first_[gone] = kNone;
}

/// Takes a triangle out and joins what was beyond its two other sides.
void Connectivity::close(uint32_t side) {
  const uint32_t after = side_end(side), last = before(side), apex = from_[last];
  const uint32_t p = twin_[after], q = twin_[last];
  if (p != kNone) twin_[p] = q;
  if (q != kNone) twin_[q] = p;
  if (first_[apex] == last) first_[apex] = p != kNone ? p : side_end(q);
  from_[side] = from_[after] = from_[last] = kNone;
}

/// Of the vertex where a side begins.
void Connectivity::find_first(uint32_t side) {
  uint32_t first = side;
  while (twin_[first] != kNone) {
    first = side_end(twin_[first]);
    if (first == side) break;
  }
  first_[from_[side]] = first;
}

}  // namespace lodlab::subdivision
