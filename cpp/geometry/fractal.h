// SPDX-License-Identifier: MIT
// Generated terrain without limits: the height is a pure function of seed, roughness, row and column, so
// that any window agrees bit for bit with any other that overlaps it.
#pragma once

#include <cstdint>

namespace lodlab {

struct Fractal {
  uint64_t seed = 1;
  double roughness = 0.5;  ///< 0 (rounded) to 1 (rugged); 0.5 has the structure function of real mountains
};

/// Heights in metres of the window of `rows` x `cols` samples whose first is (row0, col0); rows and columns
/// may be negative, up to 2^40 in size. Throws InvalidInput for a roughness outside 0 to 1.
void fractal_heights(const Fractal& fractal, int64_t row0, int64_t col0, int64_t rows, int64_t cols,
                     float* heights);

}  // namespace lodlab
