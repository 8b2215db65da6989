// SPDX-License-Identifier: MIT
// The only slack that any law of the instrument is allowed: four float steps at the distance to the eye,
// because vertices reach the rasterizer as floats relative to it, and a hundredth of a pixel.
// crack_edges has none: it compares bit for bit.
#pragma once

#include <bit>
#include <cstdint>

namespace lodlab::instrument {

inline constexpr double kSlackSteps = 4.0;
inline constexpr double kSlackPixels = 0.01;

/// The step between neighbouring floats of this size (2^(e - 23) for 2^e <= |distance|); 0 at 0.
inline double float_step(double distance) {
  const uint32_t exponent = std::bit_cast<uint32_t>(static_cast<float>(distance)) & 0x7f800000u;
  return static_cast<double>(std::bit_cast<float>(exponent)) * 0x1p-23;
}

/// How far, in source units, a drawn vertex at this distance from the eye may be from where it belongs.
inline double world_slack(double distance) { return kSlackSteps * float_step(distance); }

}  // namespace lodlab::instrument
