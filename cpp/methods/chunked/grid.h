// SPDX-License-Identifier: MIT
// The quantized samples and the error of every vertex of the 4-8 mesh over them.
//
// The mesh is a hierarchy of right triangles: a square is cut by one diagonal; a triangle splits at the
// midpoint of its hypotenuse, which it shares with one neighbour. Coordinates are (x, y) = (column, row).
// Squares of side 2^k whose indices sum to an even number are cut from corner (0, 0) to (1, 1), others the
// other way; so the pattern is one and the same for all levels and all roots.
//
// The mesh lives on a virtual grid of root squares of side 2^n. Past the last row or column a vertex takes
// the height of the border sample next to it, and triangles are later cut at the border.
#pragma once

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <vector>

#include "geometry/height_field.h"

namespace lodlab::chunked {

/// height = quantum * (k + base), k from 1 to 65535. Zero is kept free, below every sample.
struct Quantizer {
  double quantum = 1.0;
  int64_t base = 0;
  double residual = 0.0;  ///< largest |source - quantized| over all real samples, source units

  double height(double k) const { return quantum * (k + static_cast<double>(base)); }
  /// What 32-bit floats round off a height between two of these, as chunk.vert mixes them; whole ones are
  /// exact.
  double rounding() const {
    const auto low = static_cast<double>(base), most = std::max(std::abs(low), std::abs(low + 65536.0));
    return quantum * 0x1p-24 * 2.0 * (most + 65536.0);
  }
};

struct Layout {
  int32_t width = 0, height = 0;  ///< cells: columns - 1, rows - 1
  int32_t leaf = 0;               ///< side of a leaf chunk in cells, a power of two
  int32_t root = 0;               ///< side of a root chunk
  int32_t roots_x = 0, roots_y = 0;
  int levels = 0;

  int32_t side(int level) const { return root >> level; }
};

/// Roots of at most 2^15 cells, so that local coordinates fit 16 bits.
Layout make_layout(int64_t rows, int64_t cols, int32_t leaf);

/// Errors fall into classes by the upper bits of a float: sixteen an octave.
constexpr int kClassShift = 19;
constexpr size_t kErrorClasses = (127 + 20) << 4;  // up to 2^20 quanta
inline float least_of_class(size_t c) {
  return std::bit_cast<float>(static_cast<uint32_t>(c) << kClassShift);
}

class Grid {
 public:
  Grid(const HeightField& field, const Layout& layout);

  const Layout& layout() const { return layout_; }
  const Quantizer& quantizer() const { return quantizer_; }

  /// Quantized height; outside the field that of the nearest border sample.
  int32_t k(int32_t x, int32_t y) const {
    const int32_t cx = x < layout_.width ? x : layout_.width, cy = y < layout_.height ? y : layout_.height;
    return samples_[static_cast<size_t>(cy) * stride_ + cx];
  }
  const uint16_t* row(int32_t y) const { return &samples_[static_cast<size_t>(y) * stride_]; }

  /// Error of the mesh vertex: in quanta, a bound on the distance from any source sample (quantized) to
  /// either triangle that the vertex would split, and at least the errors of all vertices below it.
  float error(int32_t x, int32_t y) const { return *error_place(x, y); }

  /// Per class of errors, how many vertices inside the field have an error of that class or above.
  std::vector<int64_t> count_by_class() const;

 private:
  friend class ErrorPass;
  const float* error_place(int32_t x, int32_t y) const {
    if (x < fine_width_ && y < fine_height_) return &fine_[static_cast<size_t>(y) * fine_width_ + x];
    return &coarse_[static_cast<size_t>(y / layout_.leaf) * coarse_width_ + x / layout_.leaf];
  }

  Layout layout_;
  Quantizer quantizer_;
  int32_t stride_ = 0;
  std::vector<uint16_t> samples_;
  // Errors of all vertices up to the next multiple of a leaf, and of the few beyond: a triangle that
  // crosses the border has its midpoint in the first, or at multiples of a leaf.
  int32_t fine_width_ = 0, fine_height_ = 0, coarse_width_ = 0;
  std::vector<float> fine_, coarse_;
};

/// Whether the square with this corner and side is cut from (0, 0) to (1, 1).
inline bool main_diagonal(int32_t x, int32_t y, int32_t side) { return ((x / side + y / side) & 1) == 0; }

}  // namespace lodlab::chunked
