// SPDX-License-Identifier: MIT
// Which sides of triangles lie on the same edge; sets of things that are joined one by one.
// Triangles that name a vertex twice have no place on a surface and are left out.
#pragma once

#include <cstdint>
#include <numeric>
#include <span>
#include <vector>

#include "geometry/mesh.h"

namespace lodlab {

/// Whether it names a vertex twice.
inline bool collapsed(const Face& f) { return f[0] == f[1] || f[1] == f[2] || f[2] == f[0]; }

/// Side 3 t + k of triangle t runs from its corner k to the next. Edges are in order of their lower vertex,
/// then of their upper one; the sides of an edge are in order.
struct MeshEdges {
  std::vector<uint32_t> sides;
  std::vector<uint32_t> first;  ///< of edge e in `sides`; one more entry than there are edges

  int64_t count() const { return static_cast<int64_t>(first.size()) - 1; }
  std::span<const uint32_t> of(int64_t edge) const {
    return std::span(sides).subspan(first[edge], first[edge + 1] - first[edge]);
  }
};
MeshEdges mesh_edges(std::span<const Face> faces, int64_t vertices);

inline uint32_t side_end(uint32_t side) { return side % 3 == 2 ? side - 2 : side + 1; }
/// The vertex of a corner 3 t + k.
inline uint32_t vertex_of(std::span<const Face> faces, uint32_t corner) {
  return faces[corner / 3][corner % 3];
}

/// Disjoint sets, each known by its lowest member; a member is even or odd beside it.
class Sets {
 public:
  explicit Sets(int64_t count) : parent_(static_cast<size_t>(count)), odd_(parent_.size(), 0) {
    std::iota(parent_.begin(), parent_.end(), 0u);
  }
  uint32_t find(uint32_t i) {
    uint32_t root = i;
    bool odd = false;
    for (; parent_[root] != root; root = parent_[root]) odd ^= odd_[root] != 0;
    while (parent_[i] != i) {
      const uint32_t next = parent_[i];
      const bool rest = odd ^ (odd_[i] != 0);
      parent_[i] = root;
      odd_[i] = odd;
      i = next;
      odd = rest;
    }
    return root;
  }
  /// Odd beside the lowest of its set; after find().
  bool odd(uint32_t i) const { return odd_[i] != 0; }
  /// Joins the sets of a and b, which are then of unlike parity if `unlike`. False where they were joined
  /// already and otherwise than that.
  bool join(uint32_t a, uint32_t b, bool unlike = false) {
    const uint32_t ra = find(a), rb = find(b);
    const bool differ = odd(a) ^ odd(b) ^ unlike;
    if (ra == rb) return !differ;
    parent_[ra < rb ? rb : ra] = ra < rb ? ra : rb;
    odd_[ra < rb ? rb : ra] = differ;
    return true;
  }

 private:
  std::vector<uint32_t> parent_;
  std::vector<uint8_t> odd_;
};

/// For each triangle the first that names the same three vertices, in either sense: itself, or an earlier
/// one.
std::vector<uint32_t> first_alike(std::span<const Face> faces, int64_t vertices);

/// Corners 3 t + k that are joined round their vertices across edges of at most `most_sides` triangles.
Sets fans(std::span<const Face> faces, const MeshEdges& edges, size_t most_sides);

}  // namespace lodlab
