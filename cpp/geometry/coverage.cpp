// SPDX-License-Identifier: MIT
#include "geometry/coverage.h"

#include <algorithm>

namespace lodlab {

std::vector<std::byte> coverage_bits(const HeightField& field) {
  if (field.valid == nullptr) return {};
  if (std::all_of(field.valid, field.valid + field.rows * field.cols, [](uint8_t v) { return v != 0; }))
    return {};
  const int64_t cells = cell_columns(field);
  std::vector<std::byte> bits(static_cast<size_t>((cells * (field.rows - 1) + 7) / 8), std::byte{0});
  for (int64_t row = 0; row + 1 < field.rows; ++row) {
    for (int64_t col = 0; col < cells; ++col) {
      const int64_t next = (col + 1) % field.cols;
      const bool covered = field.is_valid(row, col) && field.is_valid(row, next) &&
                           field.is_valid(row + 1, col) && field.is_valid(row + 1, next);
      const int64_t bit = row * cells + col;
      if (covered) bits[static_cast<size_t>(bit >> 3)] |= static_cast<std::byte>(1 << (bit & 7));
    }
  }
  return bits;
}

}  // namespace lodlab
