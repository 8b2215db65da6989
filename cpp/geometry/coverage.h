// SPDX-License-Identifier: MIT
// Which cells of a height field are covered: a cell is void when any of its corners is.
// One bit a cell, row-major, least significant first, rows not padded; empty means all covered.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "geometry/height_field.h"

namespace lodlab {

/// Cells a row: one less than the columns, or as many where a planet's columns close round.
inline int64_t cell_columns(const FieldFrame& frame) { return frame.wraps ? frame.cols : frame.cols - 1; }

std::vector<std::byte> coverage_bits(const HeightField& field);

/// The same, row of cells by row of cells.
class CoverageBits {
 public:
  explicit CoverageBits(const FieldFrame& frame);
  /// Row `row` of cells, from the masks of the two rows of samples that it lies between.
  void set_row(int64_t row, const uint8_t* north, const uint8_t* south);
  std::vector<std::byte> take() { return std::move(bits_); }

 private:
  int64_t cols_, cells_;
  std::vector<std::byte> bits_;
};

}  // namespace lodlab
