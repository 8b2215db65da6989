// SPDX-License-Identifier: MIT
// Where a height lies in its patch's slot (slots.h).
#include "methods/seamless/slots.h"

namespace lodlab::seamless {

Slots::Slots(const Layout& layout, bool averaged)
    : segments_(layout.segments()), resolutions_(layout.resolutions), first_{0} {
  const int lattices = averaged ? resolutions_ : 1;
  for (int i = 0; i < lattices; ++i) {
    const int strips = std::max(side(i) / kStrip, 1);
    first_.push_back(first_.back() + strips * pitch(i) * (side(i) + 1));
  }
}

int Slots::index(const Triangle& t, size_t corner) const {
  const Vertex& at = t[corner];
  const int lattice = first_.size() > 2 ? resolutions_ - 1 - at.resolution : 0;
  const int strip = (std::min({t[0].u, t[1].u, t[2].u}) >> lattice) / kStrip;
  return first_[static_cast<size_t>(lattice)] +
         (strip * (side(lattice) + 1) + (at.v >> lattice)) * pitch(lattice) + (at.u >> lattice) -
         strip * kStrip;
}

Bytes Slots::arrange(const std::vector<float>& page) const {
  std::vector<float> out;
  out.reserve(static_cast<size_t>(floats()));
  auto rows = page.begin();
  for (int i = 0; i + 1 < static_cast<int>(first_.size()); ++i) {
    const int length = side(i) + 1;
    for (int left = 0; left < side(i); left += kStrip) {
      for (int v = 0; v < length; ++v) {
        const auto from = rows + (v * length + left);
        out.insert(out.end(), from, from + pitch(i));
      }
    }
    rows += length * length;
  }
  const auto bytes = as_bytes(out);
  return Bytes(bytes.begin(), bytes.end());
}

}  // namespace lodlab::seamless
