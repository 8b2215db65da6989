// SPDX-License-Identifier: MIT
// What is made of a layout: its levels over a frame, the size of its pages.
#include "methods/seamless/layout.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "methods/seamless/seamless.h"

namespace lodlab::seamless {

Layout make_layout(const FieldFrame& frame, int patch_log2, int resolutions, int finest_log2) {
  Layout layout;
  layout.rows = frame.rows;
  layout.cols = frame.cols;
  layout.patch_log2 = patch_log2;
  layout.resolutions = resolutions;
  layout.finest_log2 = finest_log2;
  const auto cells = static_cast<uint64_t>(std::max(layout.last_row(), layout.last_col()));
  const auto whole = static_cast<int>(std::bit_width(cells - 1));  // log2 of a patch that covers the field
  const int beyond = std::max(whole - patch_log2 - finest_log2, 0), branch = layout.branch_log2();
  layout.levels = 1 + (beyond + branch - 1) / branch;
  return layout;
}

int64_t page_samples(const Layout& layout, bool averaged) {
  int64_t sum = 0;
  for (int k = layout.resolutions - 1; k >= (averaged ? 0 : layout.resolutions - 1); --k) {
    const int64_t side = (layout.segments() >> (layout.resolutions - 1 - k)) + 1;
    sum += side * side;
  }
  return sum;
}

std::vector<Level> make_levels(const Layout& layout, const FieldFrame& frame) {
  std::vector<Level> levels;
  for (int l = 0; l < layout.levels; ++l) {
    const double width = std::ldexp(frame.dx, layout.side_log2(l));
    const double height = std::ldexp(frame.dy, layout.side_log2(l));
    levels.push_back({layout.across(l), layout.down(l), layout.first(l), layout.first_edge(l), width, height,
                      std::max(width, height)});
  }
  return levels;
}

}  // namespace lodlab::seamless
