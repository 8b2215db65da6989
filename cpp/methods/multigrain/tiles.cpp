// SPDX-License-Identifier: MIT
#include "methods/multigrain/tiles.h"

namespace lodlab::multigrain {

Tiles::Tiles(const Layout& layout)
    : layout_(layout), side_log2_(std::min(layout.most_log2, layout.chart_log2)), first_{0} {
  for (int a = 0; a <= layout.largest_stride_log2(); ++a)
    first_.push_back(first_.back() + across(a) * down(a));
}

Tile Tiles::at(int64_t id) const {
  const auto next = std::upper_bound(first_.begin(), first_.end(), id);
  const int a = static_cast<int>(next - first_.begin()) - 1, log2 = a + side_log2_;
  const int64_t place = id - *(next - 1), row = place / across(a) << log2, col = place % across(a) << log2;
  return {a, row, col, layout_.cells_y(row, log2, a) + 1, layout_.cells_x(col, log2, a) + 1};
}

void Tiles::fill(const HeightRows& band, const Tile& tile, float* heights) const {
  const int64_t last = source_col(tile, tile.cols - 1);
  for (int64_t j = 0; j < tile.rows; ++j) {
    const int64_t row = source_row(tile, j);
    if (row < band.first_row || row >= band.end_row) continue;
    const float* z = band.row(row);
    float* to = heights + j * tile.cols;
    if ((layout_.pole_first && row == 0) || (layout_.pole_last && row == layout_.last_row())) {
      std::fill_n(to, tile.cols, z[0]);
      continue;
    }
    for (int64_t i = 0; i + 1 < tile.cols; ++i) to[i] = z[tile.col + (i << tile.stride_log2)];
    to[tile.cols - 1] = z[last % band.cols];
  }
}

}  // namespace lodlab::multigrain
