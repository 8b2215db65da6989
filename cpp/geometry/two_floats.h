// SPDX-License-Identifier: MIT
// A double as the sum of two floats, as shaders take it.
#pragma once

namespace lodlab {

/// Never vectorized with its neighbours: GCC 12 then forgets to round the first of them.
[[gnu::noinline]] inline void split(double value, float& high, float& low) {
  high = static_cast<float>(value);
  low = static_cast<float>(value - static_cast<double>(high));
}

}  // namespace lodlab
