// SPDX-License-Identifier: MIT
#include "methods/seamless/squares.h"

#include <algorithm>

namespace lodlab::seamless {

MapUser map_user(const Layout& layout) {
  return {"seamless", layout.finest_log2 + kSquareLog2, "take a smaller finest_error"};
}

Maps maps_of(const Hierarchy& hierarchy) {
  return {*hierarchy.store, hierarchy.frame, map_user(hierarchy.layout).piece_log2};
}

MapSquare PatchSquares::square(int64_t row, int64_t col, int size_log2, uint32_t node, int least_log2) const {
  const FieldFrame& frame = hierarchy_->frame;
  const int64_t side = int64_t{1} << size_log2;
  Box box;
  box.add(frame.position(row, col, frame.z_min));
  box.add(frame.position(std::min(row + side, frame.rows - 1), std::min(col + side, frame.cols - 1),
                         frame.z_max));
  return {row, col, size_log2, box, node, least_log2};
}

MapSquare PatchSquares::whole(const CutNode& picked) const {
  const Layout& layout = hierarchy_->layout;
  const Patch p = layout.at(picked.node);
  return square(layout.row(p), layout.col(p), layout.side_log2(p.level), picked.node,
                layout.stride_log2(p.level) + kSquareLog2);
}

std::vector<MapSquare> PatchSquares::parts(const MapSquare& whole) const {
  std::vector<MapSquare> out;
  if (whole.size_log2 <= whole.least_log2) return out;
  const int64_t half = int64_t{1} << (whole.size_log2 - 1);
  for (const int64_t row : {whole.row, whole.row + half}) {
    for (const int64_t col : {whole.col, whole.col + half}) {
      if (row < hierarchy_->layout.last_row() && col < hierarchy_->layout.last_col())
        out.push_back(square(row, col, whole.size_log2 - 1, whole.node, whole.least_log2));
    }
  }
  return out;
}

}  // namespace lodlab::seamless
