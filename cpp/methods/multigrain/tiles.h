// SPDX-License-Identifier: MIT
// Heights for drawing: for each stride 2^a that anything is drawn with, every 2^a-th sample, cut into tiles
// of 2^side_log2 cells a side that share their border samples, so that the grid of any node lies in one tile.
// Tiles are clamped like grids: what lies past the last row or column is not there, and the last ones are
// kept at every stride. A planet's column last_col is column 0 again; all of a pole's row is its column 0.
#pragma once

#include <cstdint>
#include <vector>

#include "geometry/height_rows.h"
#include "methods/multigrain/layout.h"

namespace lodlab::multigrain {

struct Tile {
  int stride_log2;
  int64_t row, col;    ///< its first sample
  int64_t rows, cols;  ///< of its own samples

  int64_t samples() const { return rows * cols; }
};

class Tiles {
 public:
  explicit Tiles(const Layout& layout);

  int64_t count() const { return first_.back(); }
  /// Ids count the tiles of stride 1 row by row, then those of stride 2, and so on.
  int64_t id(int stride_log2, int64_t row, int64_t col) const {
    const int log2 = stride_log2 + side_log2_;
    return first_[static_cast<size_t>(stride_log2)] + (row >> log2) * across(stride_log2) + (col >> log2);
  }
  Tile at(int64_t id) const;
  /// The sample's row of row `j` of a tile; of its last one, the last row that it needs.
  int64_t source_row(const Tile& tile, int64_t j) const {
    return std::min(tile.row + (j << tile.stride_log2), layout_.last_row());
  }
  /// Likewise the column of its column `i`; of a planet that wraps, the last one is column 0 come round
  /// again.
  int64_t source_col(const Tile& tile, int64_t i) const {
    return std::min(tile.col + (i << tile.stride_log2), layout_.last_col());
  }
  /// Copies to a tile's heights, row by row, those of its rows that are in the band.
  void fill(const HeightRows& band, const Tile& tile, float* heights) const;
  /// log2 of a tile's cells a side.
  int side_log2() const { return side_log2_; }

 private:
  /// Tiles side by side at this stride.
  int64_t across(int stride_log2) const { return layout_.cells_x(0, kWhole, stride_log2 + side_log2_); }
  int64_t down(int stride_log2) const { return layout_.cells_y(0, kWhole, stride_log2 + side_log2_); }

  static constexpr int kWhole = 62;  ///< log2 of more cells than any field has
  Layout layout_;
  int side_log2_;
  std::vector<int64_t> first_;  ///< id of each stride's first tile; their number
};

}  // namespace lodlab::multigrain
