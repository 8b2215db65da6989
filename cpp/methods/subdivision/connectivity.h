// SPDX-License-Identifier: MIT
// The triangles of a manifold while edges of it collapse. Side 3 t + k of triangle t runs from its corner k
// to the next (mesh_edges.h); each knows its twin, the side that runs back along the same edge. A vertex
// knows the first side of its fan, counter-clockwise: on a border that which has no twin.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh_edges.h"

namespace lodlab::subdivision {

inline constexpr uint32_t kNone = ~uint32_t{0};

class Connectivity {
 public:
  /// Every vertex must be of a triangle, and no triangle may name one twice.
  Connectivity(std::span<const Face> faces, int64_t vertices);
  /// Whether each edge has one triangle or two that run along it in opposite senses, and each vertex one fan.
  /// Nothing else may be asked where not.
  bool manifold() const { return manifold_; }

  uint32_t sides() const { return static_cast<uint32_t>(from_.size()); }
  bool gone(uint32_t side) const { return from_[side] == kNone; }
  uint32_t from(uint32_t side) const { return from_[side]; }
  uint32_t to(uint32_t side) const { return from_[side_end(side)]; }
  uint32_t apex(uint32_t side) const { return from_[before(side)]; }
  uint32_t twin(uint32_t side) const { return twin_[side]; }
  static uint32_t before(uint32_t side) { return side % 3 == 0 ? side + 2 : side - 1; }

  uint32_t first(uint32_t vertex) const { return first_[vertex]; }
  bool on_border(uint32_t vertex) const { return twin_[first_[vertex]] == kNone; }
  /// The side after `side` in the fan of its vertex; kNone after the last one.
  uint32_t next(uint32_t side) const {
    const uint32_t out = twin_[before(side)];
    return out == first_[from_[side]] ? kNone : out;
  }

  /// Makes the end of a side its beginning; the triangles on that edge go. The collapse must keep a manifold.
  void collapse(uint32_t side);

 private:
  void close(uint32_t side);
  void find_first(uint32_t side);

  std::vector<uint32_t> from_, twin_, first_;
  bool manifold_ = true;
};

}  // namespace lodlab::subdivision
