// SPDX-License-Identifier: MIT
#include "geometry/coverage.h"

#include <algorithm>

namespace lodlab {

std::vector<std::byte> coverage_bits(const HeightField& field) {
  if (field.valid == nullptr) return {};
  if (std::all_of(field.valid, field.valid + field.rows * field.cols, [](uint8_t v) { return v != 0; }))
    return {};
  CoverageBits bits(field);
  for (int64_t row = 0; row + 1 < field.rows; ++row)
    bits.set_row(row, field.valid + row * field.cols, field.valid + (row + 1) * field.cols);
  return bits.take();
}

CoverageBits::CoverageBits(const FieldFrame& frame)
    : cols_(frame.cols),
      cells_(cell_columns(frame)),
      bits_(static_cast<size_t>((cells_ * (frame.rows - 1) + 7) / 8), std::byte{0}) {}

void CoverageBits::set_row(int64_t row, const uint8_t* north, const uint8_t* south) {
  for (int64_t col = 0; col < cells_; ++col) {
    const int64_t next = (col + 1) % cols_, bit = row * cells_ + col;
    const bool covered = north[col] != 0 && north[next] != 0 && south[col] != 0 && south[next] != 0;
    if (covered) bits_[static_cast<size_t>(bit >> 3)] |= static_cast<std::byte>(1 << (bit & 7));
  }
}

}  // namespace lodlab
