// SPDX-License-Identifier: MIT
// How the heights of a patch lie in its slot on the GPU, where they are the vertices: row by row. Rows are a
// little longer than the lattice is where the software device's vertex cache, which has 256 places by vertex
// number, would otherwise put neighbours into one place (METHOD.md, Drawing). With pyramid=average a slot is
// a page: the lattice of the finest resolution, then those of the coarser ones.
#pragma once

#include <vector>

#include "methods/seamless/mesh.h"
#include "store/store.h"

namespace lodlab::seamless {

inline constexpr int kStrip = 16;  ///< lattice cells across a strip of triangles (ranges.h)

class Slots {
 public:
  Slots(const Layout& layout, bool averaged);

  /// Heights a row of the finest lattice.
  int pitch() const { return pitch_; }
  int floats() const { return floats_; }
  int64_t bytes() const { return floats_ * static_cast<int64_t>(sizeof(float)); }
  /// Which height of its patch's slot a vertex has.
  int index(const Vertex& v) const;
  /// A page (seamless.h) as it lies in a slot.
  Bytes arrange(const std::vector<float>& page) const;

 private:
  int segments_, resolutions_;
  bool averaged_;
  int pitch_, floats_;
};

}  // namespace lodlab::seamless
