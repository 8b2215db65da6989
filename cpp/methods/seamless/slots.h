// SPDX-License-Identifier: MIT
// How the heights of a patch lie in its slot on the GPU, where they are the vertices: in strips of 16 lattice
// cells, 17 heights a row, one strip after the other, so that triangles that run down a strip (ranges.h) read
// memory as it lies. With pyramid=average that of the finest resolution is followed by those of the coarser
// ones. patch.vert goes the way back.
#pragma once

#include <algorithm>
#include <vector>

#include "methods/seamless/mesh.h"
#include "store/store.h"

namespace lodlab::seamless {

inline constexpr int kStrip = 16;  // lattice cells; patch.vert knows it too

class Slots {
 public:
  Slots(const Layout& layout, bool averaged);

  int floats() const { return first_.back(); }
  int64_t bytes() const { return floats() * static_cast<int64_t>(sizeof(float)); }
  /// Which height of its patch's slot vertex `corner` of a triangle has: on the line between two strips, that
  /// of the triangle's own.
  int index(const Triangle& t, size_t corner) const;
  /// A page (seamless.h) as it lies in a slot.
  Bytes arrange(const std::vector<float>& page) const;

 private:
  int side(int lattice) const { return segments_ >> lattice; }
  int pitch(int lattice) const { return std::min(side(lattice), kStrip) + 1; }

  int segments_, resolutions_;
  std::vector<int> first_;  ///< of each lattice, the finest first; then the end
};

}  // namespace lodlab::seamless
