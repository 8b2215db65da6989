// SPDX-License-Identifier: MIT
#include "methods/seamless/slots.h"

#include <algorithm>

#include "methods/seamless/seamless.h"

namespace lodlab::seamless {
namespace {

constexpr int kCachePlaces = 256;

/// Whether two rows of a strip, of vertices `stride` lattice points apart, share places of the cache.
bool rows_collide(int pitch, int stride, int width) {
  const int apart = stride * pitch % kCachePlaces;
  return apart <= width || kCachePlaces - apart <= width;
}

int pitch_of(const Layout& layout, bool averaged) {
  const int width = std::min(kStrip, layout.segments());
  int pitch = layout.segments() + 1;
  const auto collides = [&] {
    for (int i = 0; i < layout.resolutions; ++i) {
      if (rows_collide(pitch, 1 << i, width)) return true;
    }
    return false;
  };
  while (!averaged && collides()) ++pitch;
  return pitch;
}

}  // namespace

Slots::Slots(const Layout& layout, bool averaged)
    : segments_(layout.segments()),
      resolutions_(layout.resolutions),
      averaged_(averaged),
      pitch_(pitch_of(layout, averaged)),
      floats_(averaged ? static_cast<int>(page_samples(layout, true)) : pitch_ * (segments_ + 1)) {}

int Slots::index(const Vertex& v) const {
  if (!averaged_) return v.v * pitch_ + v.u;
  const int coarser = resolutions_ - 1 - v.resolution;
  int first = 0;
  for (int i = 0; i < coarser; ++i) first += ((segments_ >> i) + 1) * ((segments_ >> i) + 1);
  return first + (v.v >> coarser) * ((segments_ >> coarser) + 1) + (v.u >> coarser);
}

Bytes Slots::arrange(const std::vector<float>& page) const {
  std::vector<float> out(static_cast<size_t>(floats_));
  const int rows = averaged_ ? 1 : segments_ + 1;
  const auto length = static_cast<int>(page.size()) / rows, step = averaged_ ? floats_ : pitch_;
  for (int j = 0; j < rows; ++j) std::copy_n(page.begin() + j * length, length, out.begin() + j * step);
  const auto bytes = as_bytes(out);
  return Bytes(bytes.begin(), bytes.end());
}

}  // namespace lodlab::seamless
