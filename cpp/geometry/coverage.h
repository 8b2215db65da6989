// SPDX-License-Identifier: MIT
// Which cells of a height field are covered: a cell is void when any of its corners is.
// One bit a cell, row-major, least significant first, rows not padded; empty means all covered.
#pragma once

#include <cstddef>
#include <vector>

#include "geometry/height_field.h"

namespace lodlab {

/// Cells a row: one less than the columns, or as many where a planet's columns close round.
inline int64_t cell_columns(const FieldFrame& frame) { return frame.wraps ? frame.cols : frame.cols - 1; }

std::vector<std::byte> coverage_bits(const HeightField& field);

}  // namespace lodlab
