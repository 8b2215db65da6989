// SPDX-License-Identifier: MIT
// The meshes that patches are made of, in lattice points (u east, v south) of a patch: triangular tiles, one
// an edge, and strips along the half diagonals that join two tiles of any resolutions (Livny, Kogan, El-Sana,
// section 3, figures 3 and 4). A tile is the whole lattice cells between two diagonals; a strip the cells on
// one, in two halves, one on each side of it; the diagonal has the finer of its two resolutions. Everything
// is made once for one edge and turned to the other three. Cells are cut as in the 4-8 mesh: with stride 1
// everywhere a patch is the source's own surface.
//
// Invariants: the pieces of a patch tile it exactly once, whatever its four resolutions, counter-clockwise
// seen from above, and its boundary has exactly the segments of its edges' resolutions. Every triangle keeps
// its orientation, or collapses, under any monotone map of u and of v: clamped borders turn nothing over.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "methods/seamless/layout.h"

namespace lodlab::seamless {

struct Vertex {
  int16_t u, v;
  int16_t resolution;  ///< of the tile or diagonal that it belongs to

  bool operator==(const Vertex&) const = default;
};
using Triangle = std::array<Vertex, 3>;

/// Resolutions of the four edges, in the order of Edge.
using Resolutions = std::array<int, 4>;

/// The four as one number, and back: what a cut calls the resolution of a patch.
inline int pack(const Resolutions& k, int resolutions) {
  return ((k[3] * resolutions + k[2]) * resolutions + k[1]) * resolutions + k[0];
}
Resolutions unpack(int packed, int resolutions);
/// How many such numbers there are.
int packed_count(int resolutions);

enum class Side { kStart, kEnd };  ///< of an edge, walked with the patch to the left

/// The pieces of a patch of 2^patch_log2 lattice cells, and their triangles.
class PatchMesh {
 public:
  PatchMesh(int patch_log2, int resolutions);

  int segments() const { return 1 << patch_log2_; }
  int resolutions() const { return resolutions_; }

  const std::vector<Triangle>& tile(Edge e, int k) const {
    return tiles_[static_cast<size_t>(e * resolutions_ + k)];
  }
  /// The half of a strip on this edge's side, where the diagonal has resolution `diagonal` >= k.
  const std::vector<Triangle>& half(Edge e, Side side, int k, int diagonal) const {
    return halves_[half_index(e, side, k, diagonal)];
  }
  /// The strip from the end of edge e to the start of the next one (walked with the patch to the left).
  static Edge next(Edge e) { return static_cast<Edge>((e + 3) % 4); }

  /// Triangles of a patch that are there when lattice lines from clip_x and clip_y on sit on the border.
  int64_t triangles(const Resolutions& k, int clip_x, int clip_y) const {
    const bool whole = clip_x == segments() && clip_y == segments();
    return whole ? whole_[static_cast<size_t>(pack(k, resolutions_))] : clipped_triangles(k, clip_x, clip_y);
  }

  /// All pieces, numbered: for counts and index ranges.
  int pieces() const { return static_cast<int>(tiles_.size() + halves_.size()); }
  int tile_piece(Edge e, int k) const { return e * resolutions_ + k; }
  int half_piece(Edge e, Side side, int k, int diagonal) const {
    return static_cast<int>(tiles_.size() + half_index(e, side, k, diagonal));
  }
  const std::vector<Triangle>& piece(int i) const {
    const auto at = static_cast<size_t>(i);
    return at < tiles_.size() ? tiles_[at] : halves_[at - tiles_.size()];
  }
  /// The pieces of a patch: four tiles, then the two halves of each of four strips.
  std::array<int, 12> pieces_of(const Resolutions& k) const;

 private:
  size_t half_index(Edge e, Side side, int k, int diagonal) const {
    return static_cast<size_t>(((e * 2 + static_cast<int>(side)) * resolutions_ + k) * resolutions_ +
                               diagonal);
  }
  int64_t clipped_triangles(const Resolutions& k, int clip_x, int clip_y) const;
  int count(int piece, int clip_x, int clip_y) const;

  int patch_log2_, resolutions_;
  std::vector<std::vector<Triangle>> tiles_, halves_;
  std::vector<int64_t> whole_;           ///< triangles of an unclipped patch, by its packed resolutions
  mutable std::vector<int32_t> counts_;  ///< of clipped pieces, -1: not counted yet
};

/// Whether a triangle has an area when lattice lines from clip_x and clip_y on sit on the border.
inline bool remains(const Triangle& t, int clip_x, int clip_y) {
  const auto at = [&](const Vertex& p) {
    return std::array<int, 2>{std::min<int>(p.u, clip_x), std::min<int>(p.v, clip_y)};
  };
  const auto a = at(t[0]), b = at(t[1]), c = at(t[2]);
  return (b[0] - a[0]) * (c[1] - a[1]) != (c[0] - a[0]) * (b[1] - a[1]);
}

}  // namespace lodlab::seamless
