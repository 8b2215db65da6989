// SPDX-License-Identifier: MIT
// Ranges of indices that patches share: the pieces of mesh.h composed for the resolutions of a patch, without
// the triangles that a clamped border collapses. Made on demand, kept.
//
// Triangles run down strips of 16 lattice cells, so that the row above is still in the vertex cache. The last
// vertex of a triangle that is part of a strip along a diagonal lies on it, where no vertex of a tile does: a
// flat output of the vertex tells the two apart.
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <vector>

#include "methods/seamless/slots.h"

namespace lodlab::seamless {

class Ranges {
 public:
  Ranges(const PatchMesh& mesh, const Slots& slots) : mesh_(mesh), slots_(slots) {}

  struct Range {
    uint32_t first_index, indices, vertices;
  };
  /// Indices count from the slot's first height.
  Range range(const Resolutions& k, int clip_x, int clip_y);
  /// All of them, one after the other; only grows. A slot has at most 24,000 heights.
  const std::vector<uint16_t>& indices() const { return indices_; }

  /// Bytes of all that a layout can ask for.
  static int64_t most_bytes(const PatchMesh& mesh, const Layout& layout);

 private:
  struct Key {
    Resolutions k;
    int clip_x, clip_y;
    auto operator<=>(const Key&) const = default;
  };
  Range compose(const Key& key);

  const PatchMesh& mesh_;
  Slots slots_;
  std::map<Key, Range> ranges_;
  std::vector<uint16_t> indices_;
};

}  // namespace lodlab::seamless
