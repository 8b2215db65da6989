// SPDX-License-Identifier: MIT
// Ranges of indices that patches share: the pieces of mesh.h composed for the resolutions of a patch, without
// the triangles that a clamped border collapses. Made on demand, kept.
//
// Triangles run down strips of 16 lattice cells, so that the row above is still in the vertex cache; where
// patches may be cut up (squares.h), along a Z-order of the least squares, so that any larger one is a part
// of the range. The last vertex of a triangle that is part of a strip along a diagonal lies on it, where no
// vertex of a tile does: a flat output of the vertex tells the two apart.
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <vector>

#include "methods/seamless/slots.h"

namespace lodlab::seamless {

class Ranges {
 public:
  Ranges(const PatchMesh& mesh, const Slots& slots, bool cut_up)
      : mesh_(mesh), slots_(slots), cut_up_(cut_up) {}

  struct Range {
    uint32_t first_index, indices, vertices;
  };
  /// Lattice cells of a patch: a square of 2^n least squares a side.
  struct Square {
    int u, v, side;
    auto operator<=>(const Square&) const = default;
  };
  /// Indices count from the slot's first height. A square that is not the whole patch: for those cut up.
  Range range(const Resolutions& k, int clip_x, int clip_y, const Square& square);
  /// All of them, one after the other; only grows.
  const std::vector<uint32_t>& indices() const { return indices_; }

  /// Bytes of all that a layout can ask for.
  static int64_t most_bytes(const PatchMesh& mesh, const Layout& layout);

 private:
  struct Key {
    Resolutions k;
    int clip_x, clip_y;
    Square square;
    auto operator<=>(const Key&) const = default;
  };
  /// A whole patch: first indices of its least squares, in their order, and the end.
  struct Whole {
    Range range;
    std::vector<uint32_t> cells;
  };
  const Whole& whole(const Resolutions& k, int clip_x, int clip_y);
  Whole compose(const Key& key);
  int cell(int u, int v) const;
  uint32_t vertices(uint32_t first_index, uint32_t indices) const;

  const PatchMesh& mesh_;
  Slots slots_;
  bool cut_up_;
  std::map<Key, Whole> wholes_;
  std::map<Key, Range> parts_;
  std::vector<uint32_t> indices_;
};

}  // namespace lodlab::seamless
